// Sections that contain the words of the query: those with more of its words first, then those with words in their title.
const FOUND = 12;
const input = document.getElementById("search"), found = document.getElementById("found");
// On a narrow screen the list of pages would stand before the text.
if (matchMedia("(max-width: 50rem)").matches) document.getElementById("pages").open = false;
function score([title, , text], words) {
  const head = title.toLowerCase(), body = text.toLowerCase();
  let sum = 0;
  for (const word of words) {
    const times = body.split(word).length - 1, inTitle = head.includes(word);
    if (inTitle || times > 0) sum += 1000 + (inTitle ? 20 : 0) + Math.min(times, 5);
  }
  return sum;
}
function around(text, words) {
  const body = text.toLowerCase(), places = words.map((word) => body.indexOf(word)).filter((at) => at >= 0);
  const at = Math.max(0, (places[0] ?? 0) - 40);
  return `${at > 0 ? "… " : ""}${text.slice(at, at + 120).trim()} …`;
}
input.oninput = () => {
  const words = input.value.toLowerCase().split(/\s+/).filter((word) => word.length > 1);
  found.replaceChildren();
  if (words.length === 0) return;
  const hits = SECTIONS.map((section) => [score(section, words), section]).filter(([points]) => points > 0).sort((a, b) => b[0] - a[0]).slice(0, FOUND);
  const list = document.createElement("ol");
  for (const [, [title, address, text]] of hits) {
    const item = document.createElement("li"), link = document.createElement("a"), some = document.createElement("p");
    link.href = address;
    link.textContent = title;
    some.textContent = around(text, words);
    item.append(link, some);
    list.append(item);
  }
  found.append(hits.length ? list : "nothing found");
};
