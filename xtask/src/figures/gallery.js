const [search, system, verdict, shown] = ["search", "system", "verdict", "shown"].map((id) => document.getElementById(id));
function choose() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const article of document.querySelectorAll("article")) {
    const text = (article.id + " " + article.textContent).toLowerCase();
    const keep = (!system.value || article.dataset.system === system.value)
      && (!verdict.value || article.classList.contains(verdict.value)) && words.every((word) => text.includes(word));
    article.hidden = !keep;
    document.querySelector(`[data-figure="${article.id}"]`).hidden = !keep;
    count += keep;
  }
  shown.textContent = count + " figures shown";
}
for (const control of [search, system, verdict]) control.addEventListener("input", choose);
document.querySelector("form").addEventListener("submit", (event) => event.preventDefault());
choose();
