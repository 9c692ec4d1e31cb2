//! `site ROOT OUT [NAME=FILE ...]`: HTML of every page of documentation that is reached from `docs/index.md`, with search. `NAME=FILE` are parts
//! that stand in OUT already, for the navigation.
//!
//! Fails if a page of `docs/` is not reached, a link leads nowhere, or a heading that a link names is not there.

mod markdown;

use markdown::{Page, Section};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::error::Error;
use std::fs;
use std::path::{Component, Path, PathBuf};

const STYLE: &str = include_str!("site.css");
const SEARCH: &str = include_str!("search.js");
const FIRST: &str = "docs/index.md";

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(root), Some(out)) = (arguments.next(), arguments.next()) else {
        return Err("expected the folder of the repository and a folder for the site".into());
    };
    let (root, out) = (PathBuf::from(root), PathBuf::from(out));
    let parts: Vec<(String, String)> = arguments
        .filter_map(|part| {
            part.split_once('=')
                .map(|(name, file)| (name.to_owned(), file.to_owned()))
        })
        .collect();
    fs::create_dir_all(&out)?;
    let site = Site::read(&root)?;
    site.check(&root)?;
    for (path, page) in &site.pages {
        fs::write(out.join(file_of(path)), site.html(path, page, &parts)?)?;
    }
    for path in &site.files {
        let target = out.join(file_of(path));
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::copy(root.join(path), target)?;
    }
    let sections: Vec<serde_json::Value> = site
        .order
        .iter()
        .flat_map(|path| {
            site.pages[path]
                .sections
                .iter()
                .map(move |section| indexed(path, section))
        })
        .collect();
    let index = format!("const SECTIONS = {};\n{SEARCH}", serde_json::to_string(&sections)?);
    fs::write(out.join("search.js"), index)?;
    fs::write(out.join("site.css"), STYLE)?;
    println!("{}: {} pages, {} sections", out.join("index.html").display(), site.pages.len(), sections.len());
    Ok(())
}

fn indexed(path: &str, section: &Section) -> serde_json::Value {
    serde_json::json!([section.title, format!("{}#{}", file_of(path), section.id), section.text])
}

/// All pages and the files that they show.
struct Site {
    pages: BTreeMap<String, Page>,
    /// Pages in the order in which they are named.
    order: Vec<String>,
    files: BTreeSet<String>,
}

impl Site {
    /// Follows the links from the first page.
    fn read(root: &Path) -> Result<Self, Box<dyn Error>> {
        let mut site = Self {
            pages: BTreeMap::new(),
            order: Vec::new(),
            files: BTreeSet::new(),
        };
        let mut waiting = VecDeque::from([FIRST.to_owned()]);
        while let Some(path) = waiting.pop_front() {
            if site.pages.contains_key(&path) {
                continue;
            }
            let text = fs::read_to_string(root.join(&path)).map_err(|error| format!("{path}: {error}"))?;
            let page = markdown::page(&text);
            for link in &page.links {
                let Some((target, _)) = target_of(&path, link) else {
                    continue;
                };
                let file = root.join(&target);
                if target.ends_with(".md") {
                    waiting.push_back(target);
                } else if file.is_file() {
                    site.files.insert(target);
                }
            }
            site.order.push(path.clone());
            site.pages.insert(path, page);
        }
        Ok(site)
    }

    /// That every page of `docs/` is there, and that no link leads nowhere.
    fn check(&self, root: &Path) -> Result<(), Box<dyn Error>> {
        let mut faults = Vec::new();
        for entry in fs::read_dir(root.join("docs"))? {
            let name = entry?.file_name().to_string_lossy().into_owned();
            if name.ends_with(".md") && !self.pages.contains_key(&format!("docs/{name}")) {
                faults.push(format!("docs/{name} is not reached from {FIRST}"));
            }
        }
        for (path, page) in &self.pages {
            for link in &page.links {
                let Some((target, id)) = target_of(path, link) else {
                    continue;
                };
                match self.pages.get(&target) {
                    Some(page) if !id.is_empty() && !page.ids.contains(&id) => {
                        faults.push(format!("{path}: `{link}`: {target} has no heading `{id}`"));
                    }
                    None if !root.join(&target).exists() => faults.push(format!("{path}: `{link}` leads nowhere")),
                    _ => {}
                }
            }
        }
        if faults.is_empty() {
            Ok(())
        } else {
            Err(faults.join("\n").into())
        }
    }

    fn html(&self, path: &str, page: &Page, parts: &[(String, String)]) -> Result<String, Box<dyn Error>> {
        let link = |link: &str| -> Option<String> {
            let Some((target, id)) = target_of(path, link) else {
                return Some(link.to_owned());
            };
            let is_there = self.pages.contains_key(&target) || self.files.contains(&target);
            let id = if id.is_empty() { id } else { format!("#{id}") };
            is_there.then(|| format!("{}{id}", file_of(&target)))
        };
        let item = |file: &str, title: &str| {
            let here = if file == file_of(path) {
                " aria-current=\"page\""
            } else {
                ""
            };
            format!("<li><a href=\"{file}\"{here}>{}</a></li>", markdown::escaped(title))
        };
        let extra: String = parts.iter().map(|(name, file)| item(file, name)).collect();
        let pages: String = self
            .order
            .iter()
            .map(|path| item(&file_of(path), &self.pages[path].title))
            .collect();
        Ok(format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n<link rel=\"stylesheet\" href=\"site.css\">\n\
             <title>{title} - fewbits</title>\n</head>\n<body>\n<nav aria-label=\"Pages\">\n<p><label>Search <input id=\"search\" type=\"search\" autocomplete=\"off\"></label></p>\n\
             <div id=\"found\" role=\"status\"></div>\n<ul>{extra}</ul>\n<details id=\"pages\" open><summary>Pages</summary><ul>{pages}</ul></details>\n</nav>\n<main>\n{body}</main>\n<script src=\"search.js\"></script>\n</body>\n</html>\n",
            title = markdown::escaped(&page.title),
            body = page.html(&link),
        ))
    }
}

/// The file in the repository that a link of a page names, and the heading; `None` if it leads elsewhere.
fn target_of(page: &str, link: &str) -> Option<(String, String)> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (path, id) = link.split_once('#').unwrap_or((link, ""));
    if path.is_empty() {
        return Some((page.to_owned(), id.to_owned()));
    }
    let mut whole = PathBuf::new();
    for part in Path::new(page).parent()?.join(path).components() {
        match part {
            Component::ParentDir => {
                whole.pop();
            }
            Component::Normal(part) => whole.push(part),
            _ => {}
        }
    }
    Some((whole.to_string_lossy().replace('\\', "/"), id.to_owned()))
}

/// The file of the site for a file of the repository: pages lie beside each other.
fn file_of(path: &str) -> String {
    let Some(stem) = path.strip_suffix(".md") else {
        return format!("files/{path}");
    };
    let stem = stem.strip_prefix("docs/").unwrap_or(stem);
    format!("{}.html", stem.to_lowercase().replace('/', "-"))
}
