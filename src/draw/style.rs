//! The stylesheets: one set of colours for light and dark, and what page and figures do with it.
//!
//! Colours follow Okabe and Ito, who chose them to be told apart by every kind of colour vision.

/// Name, light, dark.
const COLOURS: [(&str, &str, &str); 21] = [
    ("paper", "#ffffff", "#15171b"),
    ("ink", "#1c1f25", "#e4e7ec"),
    ("muted", "#59616d", "#a3acb9"),
    ("grid", "#e6e9ee", "#2b3039"),
    ("axis", "#8b94a1", "#667080"),
    ("learnt", "#0072b2", "#56b4e9"),
    ("initial", "#929aa6", "#7c8693"),
    ("best", "#d55e00", "#ff8f4a"),
    ("mean", "#009e73", "#37c596"),
    ("steel", "#c3c9d2", "#4d5664"),
    ("edge", "#6f7885", "#98a2b0"),
    ("top", "#e69f00", "#f2b632"),
    ("bottom", "#7b4b1e", "#a8693a"),
    ("o0", "#3b53c4", "#6f8bff"),
    ("o1", "#6a46c9", "#9278f5"),
    ("o2", "#9440bd", "#b36be0"),
    ("o3", "#b83fa3", "#d065bf"),
    ("o4", "#d04b82", "#e46c9d"),
    ("o5", "#dc6262", "#ef7d7a"),
    ("o6", "#df7f41", "#f39a5f"),
    ("o7", "#d99a1f", "#f0bb4a"),
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
svg .line.shown{stroke:var(--ink);stroke-width:1.4px;stroke-dasharray:1 4}
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
svg .o0{fill:var(--o0);stroke:var(--o0)}
svg .o1{fill:var(--o1);stroke:var(--o1)}
svg .o2{fill:var(--o2);stroke:var(--o2)}
svg .o3{fill:var(--o3);stroke:var(--o3)}
svg .o4{fill:var(--o4);stroke:var(--o4)}
svg .o5{fill:var(--o5);stroke:var(--o5)}
svg .o6{fill:var(--o6);stroke:var(--o6)}
svg .o7{fill:var(--o7);stroke:var(--o7)}
svg .line.activation{fill:none;stroke-width:2px}
svg .line.scale{stroke:var(--ink);stroke-width:2px;stroke-linecap:butt}
svg .trial{stroke-width:1.4px;fill-opacity:.85}
svg .trial.open{fill:var(--paper);fill-opacity:.4}
svg .line.mode-halo{stroke:var(--paper);stroke-width:4.5px;stroke-opacity:.7}
svg .dot.mode,svg .dot.answer{stroke:var(--paper);stroke-width:1.5px}
svg .dot.mode{fill:var(--learnt)}
svg .dot.answer{fill:var(--best)}
svg .number{fill:var(--ink);font-weight:600}
svg .band{fill:var(--learnt);fill-opacity:.18;stroke:none}
svg .band.best{fill:var(--best)}
svg .band.mean{fill:var(--mean)}
svg .band.bottom{fill:var(--bottom)}
svg .band.top{fill:var(--top)}
svg .band.initial{fill:var(--initial)}
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
svg .line.edge{stroke:var(--edge)}
svg .line.link{stroke:var(--steel)}
svg .edge{fill:var(--edge)}
svg .link{fill:var(--steel)}
svg .line.ground{stroke:var(--axis);stroke-width:1.5px}
svg .line.string{stroke:var(--muted);stroke-width:1.2px}
svg .carried{fill:var(--ink);fill-opacity:.55;stroke:var(--ink);stroke-width:1px}
svg .object{fill:var(--top);stroke:var(--bottom);stroke-width:1px}
svg .stiffness{fill:var(--best);fill-opacity:.2;stroke:none}
svg .line.normal{stroke:var(--top);stroke-width:1.6px}
svg .normal-tip{fill:var(--top)}
";

const PAGE_RULES: &str = "\
*{box-sizing:border-box}
html{color-scheme:light dark;-webkit-text-size-adjust:100%}
body{margin:0 auto;padding:28px 12px 64px;max-width:1384px;background:var(--paper);
color:var(--ink);font:17px/1.55 Charter,'Bitstream Charter','Source Serif 4',Georgia,serif}
h1{font-size:32px;line-height:1.2;margin:0 0 6px;font-weight:600}
h2{font-size:21px;line-height:1.3;margin:52px 0 6px;font-weight:600}
p{max-width:46em;margin:8px 0}
.kicker,.terms,figcaption{color:var(--muted);font-size:15.5px}
.verdict{font-size:20px;line-height:1.45;margin:14px 0 18px;padding-left:14px;
border-left:3px solid var(--learnt)}
main+.terms{margin-top:52px}
figure{margin:0}
sub{line-height:0;font-size:.72em}
figcaption{max-width:52em;margin-top:8px}
figcaption b{color:var(--ink);font-weight:600}
svg{display:block;width:100%;height:auto;overflow:visible;margin:0 auto}
svg svg{overflow:hidden}
.row{display:grid;gap:16px 20px;margin-top:14px}
.frames{grid-template-columns:repeat(auto-fill,minmax(104px,1fr));gap:14px 8px}
.thirds{grid-template-columns:repeat(auto-fit,minmax(min(100%,300px),1fr))}
@media (min-width:1000px){.frames{grid-template-columns:repeat(8,1fr)}
.thirds{grid-template-columns:repeat(3,minmax(0,1fr))}}
.narrow{display:none}
@media (max-width:860px){.narrow{display:block}.wide{display:none}}
.half .drawing{min-width:0}
@media (min-width:861px){.half figure{display:grid;
grid-template-columns:minmax(0,500px) minmax(240px,1fr);gap:12px 40px;align-items:start}
.half figcaption{margin-top:32px}}
@media (min-width:1240px){body{padding:28px 32px 64px}
main>section:first-child h2,main>.half:first-child+.half h2{margin-top:22px}
main{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:0 56px}
section{grid-column:span 2}
section.half{grid-column:span 1}.half figure{display:block}
.half figcaption{margin-top:8px}
.half:not(.half+.half):not(:has(+.half)){grid-column:span 2}
.half:not(.half+.half):not(:has(+.half)) figure{display:grid;
grid-template-columns:minmax(0,598px) minmax(240px,1fr)}
.half:not(.half+.half):not(:has(+.half)) figcaption{margin-top:32px}}
.player{justify-items:center;position:relative}.player .row{justify-self:stretch;margin-top:0}
.player input{position:absolute;opacity:0;width:1px;height:1px}
.player label{cursor:pointer;position:absolute;top:8px;right:8px;z-index:1;background:var(--paper);border:1px solid var(--axis);border-radius:6px;padding:2px 18px;
font-size:15.5px;user-select:none}
.player:has(.row) label{left:8px;right:auto}
.half .player label{right:max(10px,calc(50% - 288px))}
.player label:hover{border-color:var(--learnt)}
.player input:focus-visible+label{outline:2px solid var(--learnt);outline-offset:2px}
.player .start{display:none}
.player input:checked~svg .moving,.player input:checked~.row .moving{animation-play-state:paused}
.player input:checked+label .start{display:inline}
.player input:checked+label .stop{display:none}
@media (prefers-reduced-motion:reduce){.player .start,.player input:checked+label .stop
{display:inline}.player .stop,.player input:checked+label .start{display:none}
.player input:checked~svg .moving,.player input:checked~.row .moving
{animation-play-state:running!important}}
.tables{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,330px),1fr));gap:8px 40px;
align-items:start}
table{border-collapse:collapse;width:100%;font-size:15.5px;font-variant-numeric:tabular-nums}
caption{text-align:left;font-weight:600;padding:6px 0}
th,td{padding:4px 8px 4px 0;text-align:left;font-weight:400;border-top:1px solid var(--grid);
vertical-align:top;overflow-wrap:anywhere}
th{color:var(--muted)}
.tables table{max-width:660px}
.tables td{text-align:right;padding-right:0}
.tables th{white-space:nowrap;overflow-wrap:normal}
.tables .origin td{text-align:left}.tables .origin th{width:7em;white-space:normal}
code{font-size:.9em}
details{margin-top:18px;border-top:1px solid var(--grid);padding-top:12px}
summary{cursor:pointer;font-weight:600}
.scroll{overflow-x:auto;margin-top:10px}
.numbers{white-space:nowrap;font-size:14px}
.trials{white-space:nowrap;font-size:14px;width:auto}
.trials th,.trials td{text-align:right;padding:2px 0 2px 14px}
pre{overflow-x:auto;font:13px/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;
border:1px solid var(--grid);padding:12px;margin:10px 0 0}
a{color:var(--learnt)}
.files,.missing{color:var(--muted);font-size:15.5px}
.missing h2{font-size:17px;color:var(--ink);margin-top:36px}
.missing ul{margin:6px 0;padding-left:20px;max-width:52em}
a.file{font-size:13px;margin-left:4px}
@page{margin:16mm 15mm}
@media print{body{padding:0;max-width:none;font-size:10.5pt;line-height:1.4}
h1{font-size:19pt}h2{font-size:12.5pt;margin-top:18pt;break-after:avoid}
.verdict{font-size:12pt;margin:8pt 0 4pt}
.kicker,.terms,figcaption,.missing,.files,table,.player label{font-size:9pt}
.narrow{display:none}.wide{display:block}
main{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:0 20pt}
section{grid-column:span 2;break-inside:avoid}section.half{grid-column:span 1}
.half figure,.half:not(.half+.half):not(:has(+.half)) figure{display:block}
.half figcaption{margin-top:6pt}.numbers{white-space:normal}.numbers th,.numbers td{padding-right:5px}
.frames{grid-template-columns:repeat(8,1fr)}.thirds{grid-template-columns:repeat(3,1fr)}
.tables{grid-template-columns:repeat(2,1fr)}
tr{break-inside:avoid}.player label,.player input,a.file,details{display:none}
a{color:inherit;text-decoration:none}}
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
