//! `index.html`: each plot beside its claims.

use super::Error;
use super::write::Directory;
use fewbits_experiments::{all, plain};
use serde_json::Value as Json;
use std::fmt::Write as _;

const STYLE: &str = "
:root { color-scheme: light; --ink: #1b1f24; --soft: #59636e; --line: #d8dee4; --good: #1a7f37; --bad: #cf222e; --none: #9a6700; }
* { box-sizing: border-box; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); max-width: 1500px; margin: 0 auto; padding: 1.5rem; }
h1 { margin: 0 0 .2rem; } h2 { margin: 0; font-size: 1.15rem; }
nav { columns: 4 15rem; margin: 1rem 0 2rem; font-size: .9rem; } nav a { display: block; }
a { color: #0a58ca; text-decoration: none; } a:hover { text-decoration: underline; }
section { border-top: 1px solid var(--line); padding: 1.2rem 0; display: grid; grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); gap: 1.5rem; }
section > header { grid-column: 1 / -1; } header p { margin: .2rem 0 0; max-width: 75rem; }
img { width: 100%; height: auto; border: 1px solid var(--line); border-radius: 4px; background: #fff; }
table { border-collapse: collapse; width: 100%; font-size: .85rem; } td, th { text-align: left; vertical-align: top; padding: .2rem .5rem; border-bottom: 1px solid var(--line); }
.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
.pass { color: var(--good); } .fail { color: var(--bad); font-weight: bold; } .skipped { color: var(--none); }
.soft { color: var(--soft); font-size: .85rem; } code { font-size: .85rem; overflow-wrap: anywhere; }
.claims { max-height: 40rem; overflow: auto; }
@media (max-width: 60rem) { section { grid-template-columns: 1fr; } }
";

/// Writes the gallery of all figures whose JSON is in the directory, those of earlier runs included.
pub(super) fn write(out: &Directory) -> Result<(), Error> {
    let mut body = String::new();
    let (mut links, mut totals) = (String::new(), [0; 3]);
    for figure in all() {
        let id = figure.about().id;
        let Ok(text) = std::fs::read_to_string(out.path().join(format!("{id}.json"))) else {
            continue;
        };
        let Ok(document) = serde_json::from_str::<Json>(&text) else {
            continue;
        };
        let counts = section(&mut body, id, &document);
        let [pass, fail, skipped] = counts;
        let class = if fail > 0 { "fail" } else { "pass" };
        let skipped = if skipped > 0 {
            format!(", {skipped} skipped")
        } else {
            String::new()
        };
        let _ =
            write!(links, "<a href=\"#{id}\">{id} <span class=\"{class}\">{pass}/{}{skipped}</span></a>", pass + fail);
        for (total, count) in totals.iter_mut().zip(counts) {
            *total += count;
        }
    }
    let [pass, fail, skipped] = totals;
    let page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>fewbits: figures</title>\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\
         <h1>fewbits: figures and their claims</h1>\
         <p><span class=\"pass\">{pass} claims hold</span>, <span class=\"{}\">{fail} fail</span>, {skipped} skipped. \
         Version {}. Behind each id: claims that hold out of those decided.</p><nav>{links}</nav>{body}</body></html>\n",
        if fail > 0 { "fail" } else { "soft" },
        env!("CARGO_PKG_VERSION"),
    );
    out.write("index.html", page.as_bytes())
}

/// Appends the section of one figure; its numbers of claims that pass, fail and were skipped.
fn section(page: &mut String, id: &str, document: &Json) -> [usize; 3] {
    let text = |key: &str| escape(document[key].as_str().unwrap_or_default());
    let files = document["files"].as_array().map(Vec::as_slice).unwrap_or_default();
    let _ = write!(page, "<section id=\"{id}\"><header><h2>{} <span class=\"soft\">{id}</span></h2>", text("title"));
    let _ = write!(page, "<p>{} <span class=\"soft\">{}</span></p></header><div>", text("caption"), text("source"));
    for name in files
        .iter()
        .filter_map(Json::as_str)
        .filter(|name| name.ends_with(".svg"))
    {
        let _ = write!(page, "<a href=\"{name}\"><img src=\"{name}\" alt=\"{}\" loading=\"lazy\"></a>", text("title"));
    }
    let links: Vec<_> = files
        .iter()
        .filter_map(Json::as_str)
        .map(str::to_owned)
        .chain([format!("{id}.json")])
        .map(|name| format!("<a href=\"{name}\">{name}</a>"))
        .collect();
    let parameters: Vec<_> = document["parameters"]
        .as_object()
        .into_iter()
        .flatten()
        .map(|(name, value)| format!("{name}={}", plain(value)))
        .collect();
    let _ = write!(
        page,
        "<p class=\"soft\">{} <br><code>{}</code> seed={} <br>{:.2} s</p></div><div class=\"claims\"><table>",
        links.join(" · "),
        escape(&parameters.join(" ")),
        document["seed"],
        document["wall_time_s"].as_f64().unwrap_or_default()
    );
    page.push_str("<tr><th></th><th>claim</th><th>measured</th><th>expected</th></tr>");
    let mut counts = [0; 3];
    for claim in document["claims"].as_array().into_iter().flatten() {
        let verdict = claim["verdict"].as_str().unwrap_or_default();
        let (kind, mark) = match verdict {
            "pass" => (0, "✓"),
            "fail" => (1, "✗"),
            _ => (2, "–"),
        };
        counts[kind] += 1;
        let tolerance = claim["tolerance"]
            .as_f64()
            .map_or(String::new(), |t| format!(" ± {}", short(t)));
        let expected = claim["expected"].as_f64().map_or_else(
            || escape(claim["expected"].as_str().unwrap_or_default()),
            |number| short(number) + &tolerance,
        );
        let _ = write!(
            page,
            "<tr><td class=\"{verdict}\" title=\"{verdict}\">{mark}</td><td>{} <span class=\"soft\">{}</span></td>\
             <td class=\"number\">{}</td><td class=\"number\">{expected}</td></tr>",
            escape(claim["statement"].as_str().unwrap_or_default()),
            escape(claim["id"].as_str().unwrap_or_default()),
            claim["value"].as_f64().map_or_else(|| "–".to_owned(), short),
        );
    }
    page.push_str("</table></div></section>\n");
    counts
}

/// A number with enough digits to read and no more.
fn short(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&number.abs()) {
        return format!("{number:.2e}");
    }
    let decimals = (6 - number.abs().log10().floor() as i32 - 1).clamp(0, 8) as usize;
    let text = format!("{number:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
