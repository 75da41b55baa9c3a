//! The documents are correct: ready configurations are valid, and the files they name exist.

mod util;

use std::path::Path;

use util::Bench;
use util::document::{Document, documents};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn what_config_prints_is_a_configuration() {
    let bench = Bench::new();
    let printed = bench.ok(&["config"]);
    let path = bench.write("all.toml", &printed);
    assert_eq!(bench.ok(&["config", "--config", path.to_str().unwrap()]), printed);
}

/// Every `path/like/this.rs` in a document exists, seen from the root or, as in links, from it.
#[test]
fn files_named_in_documents_exist() {
    let mut named = 0;
    for Document { name: document, text } in documents(root()) {
        for word in text.split(['`', '(', ')', ' ', ',', ';', '\n']) {
            let is_path = word.contains('/') && !word.contains(['{', '<', '*', ':']);
            let is_file = ["rs", "md", "json", "svg", "csv", "toml"]
                .iter()
                .any(|extension| word.ends_with(&format!(".{extension}")));
            // Sessions, what is installed and what stands beside a reader's file are not in the project.
            let is_elsewhere = ["session", "/", "./"].iter().any(|start| word.starts_with(start));
            if is_path && is_file && !is_elsewhere {
                let folder = root().join(&document).parent().unwrap().to_path_buf();
                let exists = root().join(word).exists() || folder.join(word).exists();
                assert!(exists, "{document} names {word}");
                named += 1;
            }
        }
    }
    assert!(named > 20, "only {named} files named");
}
