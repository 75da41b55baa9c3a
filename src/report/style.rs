//! The stylesheets: one set of colours for light and dark, and what page and figures do with it.
//!
//! Colours follow Okabe and Ito, who chose them to be told apart by every kind of colour vision.

/// Name, light, dark.
const COLOURS: [(&str, &str, &str); 11] = [
    ("paper", "#ffffff", "#15171b"),
    ("ink", "#1c1f25", "#e4e7ec"),
    ("muted", "#59616d", "#a3acb9"),
    ("grid", "#e6e9ee", "#2b3039"),
    ("axis", "#8b94a1", "#667080"),
    ("learnt", "#0072b2", "#56b4e9"),
    ("initial", "#929aa6", "#7c8693"),
    ("best", "#d55e00", "#ff8f4a"),
    ("mean", "#009e73", "#37c596"),
    ("top", "#e69f00", "#f2b632"),
    ("bottom", "#7b4b1e", "#a8693a"),
];

const FIGURE_RULES: &str = "\
svg{font:13px system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}
svg .page{fill:var(--paper)}
svg .text,svg .title{fill:var(--ink)}
svg .title{font-weight:600;font-size:15px}
svg .tick{fill:var(--muted)}
svg .halo{paint-order:stroke;stroke:var(--paper);stroke-width:4px;stroke-linejoin:round}
svg .line{fill:none;stroke-width:1.8px;stroke-linejoin:round;stroke-linecap:round}
svg .line.grid{stroke:var(--grid);stroke-width:1px}
svg .line.axis{stroke:var(--axis);stroke-width:1px}
svg .line.absent{stroke:var(--axis);stroke-width:1.2px}
svg .line.event{stroke:var(--muted);stroke-width:1px;stroke-dasharray:2 3}
svg .line.learnt{stroke:var(--learnt)}
svg .line.initial{stroke:var(--initial)}
svg .line.best{stroke:var(--best)}
svg .line.mean{stroke:var(--mean)}
svg .line.top{stroke:var(--top)}
svg .line.bottom{stroke:var(--bottom)}
svg .line.attractor{stroke:var(--mean);stroke-width:1.5px;stroke-dasharray:5 4}
svg .dot.success{fill:var(--learnt);stroke:var(--learnt)}
svg .dot.failure{fill:var(--paper);stroke:var(--axis);stroke-width:1.3px}
svg .dot.start{fill:var(--initial)}
svg .ellipse{stroke-width:1px;fill-opacity:.09;stroke-opacity:.45}
svg .o0{fill:#3b53c4;stroke:#3b53c4}
svg .o1{fill:#6a46c9;stroke:#6a46c9}
svg .o2{fill:#9440bd;stroke:#9440bd}
svg .o3{fill:#b83fa3;stroke:#b83fa3}
svg .o4{fill:#d04b82;stroke:#d04b82}
svg .o5{fill:#dc6262;stroke:#dc6262}
svg .o6{fill:#df7f41;stroke:#df7f41}
svg .o7{fill:#d99a1f;stroke:#d99a1f}
svg .ellipse.start{fill:none;stroke:var(--initial);stroke-dasharray:2 2}
svg .heat{fill:var(--top);stroke:none}
svg .h1{fill-opacity:.08}
svg .h2{fill-opacity:.18}
svg .h3{fill-opacity:.29}
svg .h4{fill-opacity:.41}
svg .h5{fill-opacity:.54}
svg .h6{fill-opacity:.68}
svg .h7{fill-opacity:.83}
svg .h8{fill-opacity:.98}
svg .frame{fill:none;stroke:var(--grid)}
svg .line.trail{stroke:var(--initial);stroke-width:1px;stroke-dasharray:1 3}
svg .line.travelled{stroke:var(--best);stroke-width:1.2px}
svg .line.pan{stroke:var(--ink);stroke-width:2.6px}
svg .line.handle{stroke:var(--muted);stroke-width:2px}
svg .pancake{stroke-width:.8px;stroke-linejoin:round}
svg .pancake.top{fill:var(--top);stroke:var(--top)}
svg .pancake.bottom{fill:var(--bottom);stroke:var(--bottom)}
svg .line.normal{stroke:var(--top);stroke-width:1.6px}
svg .normal-tip{fill:var(--top)}
";

const PAGE_RULES: &str = "\
*{box-sizing:border-box}
html{color-scheme:light dark;-webkit-text-size-adjust:100%}
body{margin:0 auto;padding:40px 12px 64px;max-width:1024px;background:var(--paper);
color:var(--ink);font:17px/1.55 Charter,'Bitstream Charter','Source Serif 4',Georgia,serif}
h1{font-size:32px;line-height:1.2;margin:0 0 6px;font-weight:600}
h2{font-size:21px;margin:52px 0 6px;font-weight:600}
p{max-width:46em;margin:8px 0}
.kicker,.terms,figcaption,.missing{color:var(--muted);font-size:15.5px}
.verdict{font-size:20px;line-height:1.45;margin:18px 0 24px;padding-left:14px;
border-left:3px solid var(--learnt)}
figure{margin:0}
sub{line-height:0;font-size:.72em}
figcaption{max-width:52em;margin-top:6px}
figcaption b{color:var(--ink);font-weight:600}
svg{display:block;width:100%;height:auto;overflow:visible;margin:0 auto}
svg svg{overflow:hidden}
.row{display:grid;gap:16px 20px;margin-top:14px}
.frames{grid-template-columns:repeat(auto-fill,minmax(108px,1fr));gap:14px 8px}
.thirds{grid-template-columns:repeat(auto-fit,minmax(min(100%,300px),1fr))}
.narrow{display:none}
@media (max-width:860px){.narrow{display:block}.wide{display:none}}
@media (min-width:821px){.beside{display:grid;grid-template-columns:auto minmax(260px,1fr);
gap:40px;align-items:center}.beside .row{width:500px}}
.tables{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,330px),1fr));gap:8px 40px;
align-items:start}
table{border-collapse:collapse;width:100%;font-size:15.5px;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:6px 0}
th,td{padding:4px 8px 4px 0;text-align:left;font-weight:400;border-top:1px solid var(--grid);
vertical-align:top;overflow-wrap:anywhere}
th{color:var(--muted)}
.tables td{text-align:right;padding-right:0}
details{margin-top:18px;border-top:1px solid var(--grid);padding-top:12px}
summary{cursor:pointer;font-weight:600}
.scroll{overflow-x:auto;margin-top:10px}
.trials{white-space:nowrap;font-size:14px}
.trials th,.trials td{text-align:right;padding:2px 0 2px 14px}
pre{overflow-x:auto;font:13px/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;
border:1px solid var(--grid);padding:12px;margin:10px 0 0}
a{color:var(--learnt)}
@media print{body{padding:0;max-width:none}h2{margin-top:28px}figure{break-inside:avoid}}
";

/// Stylesheet of the page and the figures within it.
pub fn page() -> String {
    let variables = |pick: fn(&(&str, &str, &str)) -> String| -> String {
        COLOURS.iter().map(pick).collect::<Vec<_>>().join("")
    };
    let light = variables(|(name, light, _)| format!("--{name}:{light};"));
    let dark = variables(|(name, _, dark)| format!("--{name}:{dark};"));
    format!(
        ":root{{{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n\
         {PAGE_RULES}{FIGURE_RULES}"
    )
}

/// Stylesheet of a stand-alone figure: without variables, which many SVG readers do not know.
pub fn figure() -> String {
    let (mut light, mut dark) = (FIGURE_RULES.to_owned(), FIGURE_RULES.to_owned());
    for (name, light_colour, dark_colour) in COLOURS {
        light = light.replace(&format!("var(--{name})"), light_colour);
        dark = dark.replace(&format!("var(--{name})"), dark_colour);
    }
    format!("{light}@media screen and (prefers-color-scheme:dark){{\n{dark}}}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_colour_in_use_is_defined() {
        assert!(!figure().contains("var("));
        for part in page().split("var(--").skip(1) {
            let name = part.split(')').next().expect("split yields a part");
            assert!(COLOURS.iter().any(|colour| colour.0 == name), "{name}");
        }
    }
}
