//! A session whose file was damaged continues unchanged.

mod util;

use util::{Bench, bits, stderr};

fn learn<'a>(rollouts: &'a str, out: &'a str) -> [&'a str; 8] {
    ["learn", "pancake", "--seed", "3", "--rollouts", rollouts, "--out", out]
}

#[test]
fn a_damaged_session_is_restored_from_its_second_copy_and_goes_on() {
    let bench = Bench::new();
    bench.ok(&learn("6", "s"));
    let (session, copy) = (bench.path("s/session.db"), bench.path("s/session.copy.db"));
    let mut bytes = std::fs::read(&session).unwrap();
    bytes[4096..].fill(0x5a);
    std::fs::write(&session, &bytes).unwrap();
    bench.refused(&["report", "s"], &["session.db is corrupted", "resume the session"]);
    // The same command as ever; the damaged file is kept for inspection.
    bench.ok(&learn("9", "s"));
    assert_eq!(std::fs::read(bench.path("s/session.damaged-1.db")).unwrap(), bytes);
    bench.ok(&learn("9", "undisturbed"));
    assert_eq!(bits(&bench.trials("s")), bits(&bench.trials("undisturbed")));

    for file in [&session, &copy] {
        let mut bytes = std::fs::read(file).unwrap();
        bytes[4096..].fill(0x5a);
        std::fs::write(file, bytes).unwrap();
    }
    let output = bench.run(&learn("10", "s"));
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("corrupted"), "{}", stderr(&output));
}
