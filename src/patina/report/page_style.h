// The look of the report page: one style sheet for light, dark and paper, and the few lines of script behind
// the wipe.
#pragma once

namespace patina::report {

inline constexpr const char* kPageStyle = R"css(
/* Colours and type. Two of the colours are what the program is about: verdigris and copper. */
:root { color-scheme: light dark; --ground:#fbfaf7; --raised:#f2efe9; --ink:#23211e; --quiet:#716b62;
  --line:#e2ddd3; --patina:#2c7a6b; --copper:#a5552b; --gold:#86690f;
  --serif:"Iowan Old Style","Palatino Linotype",Palatino,"URW Palladio L",P052,Georgia,serif;
  --sans:system-ui,-apple-system,"Segoe UI","Helvetica Neue","Noto Sans","Liberation Sans",Arial,sans-serif;
  --mono:ui-monospace,"SF Mono",Menlo,Consolas,"DejaVu Sans Mono",monospace; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ground:#171614; --raised:#211f1c; --ink:#e9e5dd; --quiet:#9c958a; --line:#35322d;
    --patina:#74c2b1; --copper:#e0946c; --gold:#d3b45a; }
}
* { box-sizing:border-box; }
html { background:var(--ground); color:var(--ink); font:16px/1.55 var(--sans);
  -webkit-text-size-adjust:100%; }
body { margin:0 auto; max-width:74rem; padding:clamp(1.25rem,4vw,4rem) clamp(1rem,4vw,3rem) 4rem; }

/* Head of the page. */
header { border-bottom:1px solid var(--line); padding-bottom:2rem; }
.mark { margin:0; color:var(--patina); font-size:.8125rem; letter-spacing:.14em; text-transform:uppercase; }
h1 { margin:.5rem 0 0; font:400 clamp(2rem,5vw,3.25rem)/1.1 var(--serif); overflow-wrap:anywhere; }
.prompt { margin:1rem 0 0; max-width:46rem; font:italic 1.375rem/1.4 var(--serif); overflow-wrap:anywhere; }
.prompt::before { content:"\201C"; }
.prompt::after { content:"\201D"; }
.negative { margin:.25rem 0 0; color:var(--quiet); overflow-wrap:anywhere; }
.negative em { font-family:var(--serif); }
.facts { display:flex; flex-wrap:wrap; gap:.25rem 2rem; margin:1.5rem 0 0; padding:0; list-style:none;
  color:var(--quiet); font-size:.9375rem; }
.facts b { color:var(--ink); font-weight:500; font-variant-numeric:tabular-nums; }

/* Sections. */
h2 { margin:3.5rem 0 .25rem; font:400 1.625rem/1.2 var(--serif); }
h3 { margin:2rem 0 .75rem; font-size:1rem; font-weight:600; overflow-wrap:anywhere; }
p.lead { margin:0 0 1.25rem; max-width:44rem; color:var(--quiet); }
img { display:block; width:100%; height:auto; background:var(--raised); border-radius:3px; }
figure { margin:0; }
figcaption, small { color:var(--quiet); font-size:.8125rem; }
figcaption { padding-top:.4rem; }
.warnings { margin:2rem 0 0; padding:1rem 1.25rem; border-left:3px solid var(--copper);
  background:var(--raised); border-radius:0 3px 3px 0; }
.warnings h2 { margin:0; font:600 .9375rem/1.4 var(--sans); color:var(--copper); }
.warnings ul { margin:.4rem 0 0; padding-left:1.1rem; }
.warnings li { margin:.2rem 0; overflow-wrap:anywhere; }
.turntable { margin-top:2.5rem; max-width:48rem; }
.turntable figcaption { display:flex; }
.turntable figcaption span { flex:1; }

/* Comparison of views: hidden radio buttons choose what the sheet shows; no script is needed. */
.choice { position:absolute; opacity:0; pointer-events:none; }
.tabs { display:inline-flex; flex-wrap:wrap; gap:2px; margin-bottom:1rem; padding:3px;
  background:var(--raised); border-radius:8px; }
.tabs label { padding:.3rem .9rem; border-radius:6px; color:var(--quiet); font-size:.9375rem;
  cursor:pointer; }
.tabs label:hover { color:var(--ink); }
#c-side:checked~.tabs [for=c-side], #c-before:checked~.tabs [for=c-before],
#c-edited:checked~.tabs [for=c-edited], #c-after:checked~.tabs [for=c-after],
#c-wipe:checked~.tabs [for=c-wipe] { background:var(--ground); color:var(--ink); box-shadow:0 1px 2px #0002; }
#c-side:focus-visible~.tabs [for=c-side], #c-before:focus-visible~.tabs [for=c-before],
#c-edited:focus-visible~.tabs [for=c-edited], #c-after:focus-visible~.tabs [for=c-after],
#c-wipe:focus-visible~.tabs [for=c-wipe] { outline:2px solid var(--patina); }
.tabs [for=c-wipe], .cut { display:none; }
.js .tabs [for=c-wipe] { display:block; }
.sheet { display:grid; grid-template-columns:repeat(var(--columns),minmax(0,1fr)); gap:.75rem; --cut:50%; }
.heads { display:none; grid-template-columns:2rem repeat(var(--kinds),minmax(0,1fr)); gap:.75rem;
  padding-bottom:.5rem; color:var(--quiet); font-size:.875rem; }
.view { display:grid; position:relative; }
.view figcaption { order:9; font-variant-numeric:tabular-nums; }
@media screen {
  #c-before:checked~.sheet img:not(.before), #c-edited:checked~.sheet img:not(.edited),
  #c-after:checked~.sheet img:not(.after) { display:none; }
  #c-wipe:checked~.sheet .edited { display:none; }
  #c-wipe:checked~.sheet img { grid-area:1/1; touch-action:pan-y; user-select:none; }
  #c-wipe:checked~.sheet .after { clip-path:inset(0 0 0 var(--cut)); }
  #c-wipe:checked~.sheet .line { grid-area:1/1; justify-self:start; width:2px;
    margin-left:calc(var(--cut) - 1px); background:#fffc; pointer-events:none; z-index:1; }
  #c-wipe:checked~.cut { display:flex; gap:.75rem; align-items:center; margin:0 0 1rem; color:var(--quiet);
    font-size:.875rem; }
  .cut input { flex:0 1 20rem; accent-color:var(--patina); }
}
#c-side:checked~.heads { display:grid; }
#c-side:checked~.sheet { grid-template-columns:minmax(0,1fr); }
#c-side:checked~.sheet .view { grid-template-columns:2rem repeat(var(--kinds),minmax(0,1fr)); gap:.75rem; }
#c-side:checked~.sheet figcaption { order:0; padding-top:.1rem; font-size:.875rem; }
#c-side:checked~.sheet figcaption span { display:none; }

/* Textures, tables, plot. */
.textures { display:grid; grid-template-columns:repeat(auto-fill,minmax(min(100%,20rem),1fr)); gap:1.5rem; }
.pair { display:grid; grid-template-columns:1fr 1fr; gap:4px; }
.pair figcaption { grid-column:1/-1; display:flex; justify-content:space-between; gap:1rem; }
.pair figcaption b { color:var(--ink); font-weight:500; }
.scroll { overflow-x:auto; }
table { width:100%; border-collapse:collapse; font-size:.9375rem; }
thead th { color:var(--quiet); font-size:.8125rem; font-weight:400; }
th, td { padding:.6rem 1rem .6rem 0; border-bottom:1px solid var(--line); text-align:left;
  vertical-align:baseline; }
th { font-weight:500; }
.value { text-align:right; font-variant-numeric:tabular-nums; white-space:nowrap; padding-right:2rem; }
.stages .value:last-child { padding-right:0; }
.metrics tbody th { width:22%; min-width:8rem; }
.text { overflow-wrap:anywhere; }
.meaning code { font-family:var(--mono); white-space:nowrap; }
.meaning { color:var(--quiet); font-size:.875rem; width:45%; padding-right:0; }
.metrics td small { display:block; }
.good::before { content:"\25CF\2002"; color:var(--patina); }
.fair::before { content:"\25D0\2002"; color:var(--gold); }
.poor::before { content:"\25CB\2002"; color:var(--copper); }
.stages { max-width:46rem; }
.stages tbody th { white-space:nowrap; }
.share { width:40%; }
.share i { display:block; height:.5rem; min-width:2px; background:var(--patina); border-radius:2px;
  opacity:.75; }
tfoot th, tfoot td { border-bottom:0; font-weight:500; }
.plot { display:block; width:100%; max-width:60rem; height:auto; font:12px var(--sans); }
.plot text { fill:var(--quiet); font-variant-numeric:tabular-nums; }
.plot path { fill:none; stroke-width:1; stroke:var(--line); vector-effect:non-scaling-stroke; }
.plot .axis { stroke:var(--quiet); }
.plot .raw { stroke:var(--patina); opacity:.35; }
.plot .curve { stroke:var(--patina); stroke-width:2; stroke-linejoin:round; }

/* Foot of the page. */
details { margin-top:3.5rem; border-top:1px solid var(--line); padding-top:1rem; }
summary { cursor:pointer; }
pre { overflow-x:auto; padding:1rem 1.25rem; background:var(--raised); border-radius:3px;
  font:.8125rem/1.6 var(--mono); }
footer { margin-top:3rem; color:var(--quiet); font-size:.8125rem; }

/* Phones. */
@media screen and (max-width:40rem) {
  .sheet { grid-template-columns:repeat(min(2,var(--columns)),minmax(0,1fr)); }
  #c-side:checked~.sheet .view, .heads { grid-template-columns:1.1rem repeat(var(--kinds),minmax(0,1fr));
    gap:.35rem; }
  .metrics thead { display:none; }
  .metrics tr { display:grid; grid-template-columns:1fr auto; border-bottom:1px solid var(--line); }
  .metrics tbody th, .metrics td { width:auto; border-bottom:0; padding:.3rem 0; }
  .metrics .value { padding-left:1rem; }
  .metrics .verdict, .metrics .text, .metrics .meaning { grid-column:1/-1; }
  .metrics .verdict:empty, .metrics .meaning:empty { display:none; }
}

/* Paper: white, always side by side. */
@media print {
  @page { margin:16mm; }
  :root { --ground:#fff; }
  html { font-size:10.5pt; }
  body { max-width:none; padding:0; }
  .tabs, .cut { display:none !important; }
  figure, tr, .plot, .warnings { break-inside:avoid; }
  h2, h3, .lead, .heads { break-after:avoid; }
  .heads, .sheet { max-width:88%; }
  #c-side~.sheet { grid-template-columns:minmax(0,1fr); }
  #c-side~.heads, #c-side~.sheet .view { display:grid;
    grid-template-columns:2rem repeat(var(--kinds),minmax(0,1fr)); gap:.75rem; }
  #c-side~.sheet figcaption { order:0; padding:0; }
  #c-side~.sheet figcaption span { display:none; }
  * { print-color-adjust:exact; -webkit-print-color-adjust:exact; }
}
)css";

// Without script every comparison but the wipe works. With it, the slider and a pointer over any view move
// all cuts at once.
inline constexpr const char* kPageScript = R"js(
document.documentElement.classList.add("js");
for (const sheet of document.querySelectorAll(".sheet")) {
  const slider = document.querySelector(".cut input");
  const cut = share => {
    slider.value = 100 * Math.min(1, Math.max(0, share));
    sheet.style.setProperty("--cut", slider.value + "%");
  };
  slider.addEventListener("input", () => cut(slider.value / 100));
  sheet.addEventListener("pointermove", event => {
    const view = event.target.closest(".view");
    if (!view || !document.getElementById("c-wipe").checked) return;
    const box = view.getBoundingClientRect();
    cut((event.clientX - box.left) / box.width);
  });
}
)js";

}  // namespace patina::report
