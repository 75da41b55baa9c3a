//! The same numbers in every dialect are the same table.

use super::*;

fn parse(text: &str) -> Table {
    Table::parse("r.csv", text).unwrap_or_else(|error| panic!("{error:#}\n{text}"))
}

fn cells(row: &Row) -> Vec<&str> {
    row.cells.iter().collect()
}

#[test]
fn recognises_separator_and_decimal_mark() {
    for (text, separator, mark) in [
        ("t,x\n0.0,1.5\n0.1,1.6\n", Separator::Comma, DecimalMark::Point),
        ("t, x\n0, 1\n1, 2\n", Separator::Comma, DecimalMark::Point),
        ("t;x\n0,0;1,5\n0,1;1,6\n", Separator::Semicolon, DecimalMark::Comma),
        ("t;x\n0.0;1.5\n0.1;1.6\n", Separator::Semicolon, DecimalMark::Point),
        ("t\tx\n0,0\t1,5\n0,1\t1,6\n", Separator::Tab, DecimalMark::Comma),
        ("t x\n0.0 1.5\n0.1 1.6\n", Separator::Spaces, DecimalMark::Point),
        ("t x\n0,0 1,5\n0,1 1,6\n", Separator::Spaces, DecimalMark::Comma),
        ("  t    x\n  0.0  1.5\n 10.1  1.6\n", Separator::Spaces, DecimalMark::Point),
        ("t|x\n0.0|1.5\n0.1|1.6\n", Separator::Pipe, DecimalMark::Point),
        ("\"t\",\"x\"\n\"0,0\",\"1,5\"\n\"0,1\",\"1,6\"\n", Separator::Comma, DecimalMark::Comma),
        ("sep=;\nt;x\n0,0;1,5\n0,1;1,6\n", Separator::Semicolon, DecimalMark::Comma),
    ] {
        let table = parse(text);
        assert_eq!((table.separator, table.decimal_mark), (separator, mark), "{text}");
        assert_eq!((cells(&table.heading[0]), table.rows.len()), (vec!["t", "x"], 2), "{text}");
        assert_eq!(table.rows[1].cells.len(), 2, "{text}");
    }
}

#[test]
fn lines_keep_their_numbers_through_comments_and_blanks() {
    let table =
        parse("// made by hand\n\nt_s,x\n\n# now\n0.0,1.5\n\n% pause\n0.1,1.6\n   \n0.2,1.7\n");
    let lines: Vec<u64> = table.rows.iter().map(|row| row.line).collect();
    assert_eq!(lines, [6, 9, 11]);
    let heading: Vec<(u64, bool)> =
        table.heading.iter().map(|row| (row.line, row.is_comment)).collect();
    assert_eq!(heading, [(1, true), (3, false), (5, true)]);
}

#[test]
fn units_stay_with_their_names_where_spaces_separate() {
    let table = parse("t [s]  x (mm) q[0] q[1]\n0 1 2 3\n1 2 3 4\n");
    assert_eq!(cells(&table.heading[0]), ["t [s]", "x (mm)", "q[0]", "q[1]"]);
    let table = parse("t state\n0.0 [0.1 0.2]\n0.1 [0.2 0.3]\n");
    assert_eq!(cells(&table.rows[0]), ["0.0", "[0.1 0.2]"]);
}

#[test]
fn quoted_cells_may_hold_separators_and_lines() {
    let table = parse("t, state\n0.0, \"[0.1, 0.2]\"\n0.1, \"[0.2,\n 0.3]\"\n0.2,\"[1, 2]\"\n");
    assert_eq!(table.separator, Separator::Comma);
    assert_eq!(table.rows[1].cells[1].split_whitespace().collect::<String>(), "[0.2,0.3]");
    assert_eq!(table.rows[2].line, 5);
}

#[test]
fn says_what_is_missing() {
    for (text, words) in [
        ("", "is empty"),
        ("\n \n", "is empty"),
        ("hello world\n", "no rows of numbers"),
        ("t_s,x_m\n", "no rows of numbers"),
    ] {
        let message = Table::parse("r.csv", text).unwrap_err().to_string();
        assert!(message.contains("r.csv") && message.contains(words), "{message}");
    }
}
