const [search, system, source, verdict, shown] = ["search", "system", "source", "verdict", "shown"].map((id) => document.getElementById(id));
function choose() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const article of document.querySelectorAll("article")) {
    const text = (article.id + " " + article.textContent).toLowerCase();
    const keep = (!system.value || article.dataset.system === system.value)
      && (!source.value || article.dataset.source === source.value)
      && (!verdict.value || article.classList.contains(verdict.value)) && words.every((word) => text.includes(word));
    article.hidden = !keep;
    document.querySelector(`[data-figure="${article.id}"]`).hidden = !keep;
    count += keep;
  }
  for (const section of document.querySelectorAll("section.system")) section.hidden = !section.querySelector("article:not([hidden])");
  shown.textContent = count + " figures shown";
}
for (const control of [search, system, source, verdict]) control.addEventListener("input", choose);
document.querySelector("form").addEventListener("submit", (event) => event.preventDefault());
choose();
// On a wide window the index is open; on a phone the first figure comes first.
if (matchMedia("(min-width: 60rem)").matches) document.querySelector("details.index").open = true;
