// Without script every comparison but the wipe works. With it, the slider and a pointer over any view
// move all cuts at once.
document.documentElement.classList.add("js");
const slider = document.querySelector(".cut input");  // null where there is nothing to wipe to
for (const sheet of slider ? document.querySelectorAll(".sheet") : []) {
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
