//! The style sheet of the pages. Colours are those of Okabe and Ito, which any colour vision tells apart.

/// Number of colours `c0`, `c1` and so on.
pub(super) const COLOURS: usize = 8;

/// The style sheet.
pub(super) const STYLE: &str = "
:root { --ink:#1d2733; --soft:#5b6875; --rule:#e3e7ec; --page:#f6f7f9; --card:#fff; }
* { box-sizing:border-box; }
body { margin:0; background:var(--page); color:var(--ink); font:15px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,sans-serif; }
main { max-width:1380px; margin:0 auto; padding:28px 24px 60px; }
h1 { font-size:26px; margin:0 0 4px; } h2 { font-size:19px; margin:0 0 10px; } h3 { font-size:15px; margin:18px 0 6px; }
p { margin:6px 0; max-width:110ch; } .soft { color:var(--soft); }
section { background:var(--card); border:1px solid var(--rule); border-radius:10px; padding:18px 20px; margin:18px 0; }
.tiles { display:grid; grid-template-columns:repeat(auto-fit,minmax(190px,1fr)); gap:12px; margin:16px 0; }
.tile { background:var(--card); border:1px solid var(--rule); border-radius:10px; padding:12px 14px; }
.tile b { display:block; font-size:23px; font-weight:600; font-variant-numeric:tabular-nums; } .tile span { color:var(--soft); font-size:13px; }
.good b { color:#00704f; } .bad b { color:#b3400b; }
.plots { display:grid; grid-template-columns:repeat(auto-fill,minmax(420px,1fr)); gap:16px; margin-top:10px; }
figure { margin:0; min-width:0; } figcaption { font-weight:600; font-size:14px; }
svg { width:100%; height:auto; display:block; }
.legend { list-style:none; display:flex; flex-wrap:wrap; gap:2px 16px; margin:2px 0 2px; padding:0; font-size:12.5px; color:var(--soft); }
.legend li { display:flex; align-items:center; gap:6px; }
.key { display:inline-block; } .key.stroke { width:22px; border-top:2.5px solid currentColor; } .key.stroke.dashed { border-top-style:dashed; }
.key.dot { width:8px; height:8px; border-radius:50%; background:currentColor; } .key.fill { width:12px; height:12px; border-radius:2px; background:currentColor; }
.grid { stroke:#eceff2; stroke-width:1; } .axis { stroke:#8b96a1; stroke-width:1.2; fill:none; }
.tick { font-size:12px; fill:#5b6875; } .label { font-size:13px; fill:#1d2733; }
.line { fill:none; stroke:currentColor; stroke-width:1.6; stroke-linejoin:round; } .line.dashed { stroke-dasharray:6 4; } .line.thin { stroke-width:1; }
.area { fill:currentColor; stroke:none; } .dots { stroke:currentColor; stroke-width:5; stroke-linecap:round; fill:none; } .dots.small { stroke-width:2.6; }
.c0 { color:#0072b2; } .c1 { color:#d55e00; } .c2 { color:#009e73; } .c3 { color:#cc79a7; } .c4 { color:#e69f00; } .c5 { color:#56b4e9; } .c6 { color:#8a6d3b; } .c7 { color:#6b7280; }
.ok { color:#9fd3bf; } .grey { color:#8b96a1; } .hazard { color:#d55e00; fill-opacity:.16; } .key.hazard { opacity:.35; } .idle { color:#8b96a1; fill-opacity:.14; } .key.idle { opacity:.35; }
.scroll { overflow-x:auto; } table { border-collapse:collapse; font-size:13.5px; margin:8px 0; font-variant-numeric:tabular-nums; }
th { text-align:right; font-weight:600; color:var(--soft); border-bottom:1.5px solid var(--rule); padding:4px 12px; vertical-align:bottom; }
td { text-align:right; padding:3px 12px; border-bottom:1px solid var(--rule); white-space:nowrap; }
th:first-child,td:first-child,td.words,th.words { text-align:left; } td.words { white-space:normal; }
td.bad { color:#b3400b; font-weight:600; } td.good { color:#00704f; }
.warn { border-left:4px solid #d55e00; } code { font-size:13px; background:var(--page); padding:1px 4px; border-radius:4px; } ul { margin:6px 0; padding-left:22px; }
a { color:#0072b2; }
@media print { body { background:#fff; } section,.tile { break-inside:avoid; } }
";
