//! Files of the page, embedded: it needs no network and no installation.
//!
//! `vendor` holds libraries of others as `dist/vendor-web` makes them, compressed; their licences are beside them.

pub struct Asset {
    pub media_type: &'static str,
    pub is_gzip: bool,
    pub bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The file of a path, without its first slash.
pub fn find(path: &str) -> Option<Asset> {
    let plain = |media_type, bytes| Some(Asset { media_type, is_gzip: false, bytes });
    let gzip = |bytes| Some(Asset { media_type: SCRIPT, is_gzip: true, bytes });
    match path {
        "" => plain(HTML, include_bytes!("../page/index.html")),
        "page.css" => plain(CSS, include_bytes!("../page/page.css")),
        "uplot.css" => plain(CSS, include_bytes!("../page/vendor/uplot.min.css")),
        "main.js" => plain(SCRIPT, include_bytes!("../page/main.js")),
        "stream.js" => plain(SCRIPT, include_bytes!("../page/stream.js")),
        "state.js" => plain(SCRIPT, include_bytes!("../page/state.js")),
        "scene.js" => plain(SCRIPT, include_bytes!("../page/scene.js")),
        "curves.js" => plain(SCRIPT, include_bytes!("../page/curves.js")),
        "commands.js" => plain(SCRIPT, include_bytes!("../page/commands.js")),
        "vendor/three.js" => gzip(include_bytes!("../page/vendor/three.min.js.gz")),
        "vendor/uplot.js" => gzip(include_bytes!("../page/vendor/uplot.min.js.gz")),
        _ => None,
    }
}
