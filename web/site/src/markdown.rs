//! A page of documentation: its text as HTML, its headings, its links, and its sections for the search.

use pulldown_cmark::{CodeBlockKind, CowStr, Event, Options, Parser, Tag, TagEnd, html};
use std::collections::{BTreeMap, BTreeSet};

/// A page.
pub struct Page {
    pub title: String,
    pub links: Vec<String>,
    /// Names of its headings in links.
    pub ids: BTreeSet<String>,
    pub sections: Vec<Section>,
    events: Vec<Event<'static>>,
}

/// A heading and the text below it.
pub struct Section {
    pub title: String,
    pub id: String,
    pub text: String,
}

/// Parses the text of a page.
pub fn page(text: &str) -> Page {
    let options = Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES | Options::ENABLE_STRIKETHROUGH;
    let mut events: Vec<Event<'static>> = Parser::new_ext(text, options).map(Event::into_static).collect();
    let mut page = Page {
        title: String::new(),
        links: Vec::new(),
        ids: BTreeSet::new(),
        sections: Vec::new(),
        events: Vec::new(),
    };
    let (mut heading, mut counts) = (None, BTreeMap::new());
    let mut hides = false;
    for i in 0..events.len() {
        match &events[i] {
            Event::Start(Tag::Heading { .. }) => heading = Some((i, String::new())),
            Event::End(TagEnd::Heading(_)) => {
                if let Some((start, title)) = heading.take() {
                    let id = distinct(slug(&title), &mut counts);
                    if let Event::Start(Tag::Heading { id: own, .. }) = &mut events[start] {
                        *own = Some(CowStr::from(id.clone()));
                    }
                    if page.title.is_empty() {
                        page.title.clone_from(&title);
                    }
                    page.ids.insert(id.clone());
                    page.sections.push(Section {
                        title,
                        id,
                        text: String::new(),
                    });
                }
            }
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                page.links.push(dest_url.to_string())
            }
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                hides = language.is_empty() || language.starts_with("rust")
            }
            Event::Text(text) if hides => {
                let shown: String = text.split_inclusive('\n').filter(|line| !is_hidden(line)).collect();
                add(&mut page, &shown);
                events[i] = Event::Text(CowStr::from(shown));
            }
            Event::End(TagEnd::CodeBlock) => hides = false,
            Event::Text(text) | Event::Code(text) => match &mut heading {
                Some((_, title)) => title.push_str(text),
                None => add(&mut page, text),
            },
            Event::SoftBreak | Event::HardBreak | Event::End(TagEnd::Paragraph | TagEnd::TableCell | TagEnd::Item) => {
                add(&mut page, " ")
            }
            _ => {}
        }
    }
    page.events = events;
    page
}

impl Page {
    /// The page as HTML. `link` gives the address of a link; where there is none its text alone is written.
    pub fn html(&self, link: &dyn Fn(&str) -> Option<String>) -> String {
        let mut open = Vec::new();
        let events = self.events.iter().filter_map(|event| match event {
            Event::Start(Tag::Link {
                link_type,
                dest_url,
                title,
                id,
            }) => {
                let found = link(dest_url);
                open.push(found.is_some());
                let dest_url = CowStr::from(found?);
                Some(Event::Start(Tag::Link {
                    link_type: *link_type,
                    dest_url,
                    title: title.clone(),
                    id: id.clone(),
                }))
            }
            Event::End(TagEnd::Link) => open.pop()?.then(|| event.clone()),
            Event::Start(Tag::Image {
                link_type,
                dest_url,
                title,
                id,
            }) => {
                let dest_url = CowStr::from(link(dest_url).unwrap_or_default());
                Some(Event::Start(Tag::Image {
                    link_type: *link_type,
                    dest_url,
                    title: title.clone(),
                    id: id.clone(),
                }))
            }
            event => Some(event.clone()),
        });
        let mut out = String::new();
        html::push_html(&mut out, events.collect::<Vec<_>>().into_iter());
        // Wide tables and programs scroll within themselves.
        let mut parts = out.split("<table>");
        let mut wrapped = parts.next().unwrap_or_default().to_owned();
        for (i, part) in parts.enumerate() {
            let label = format!("Table {} of this page", i + 1);
            wrapped +=
                &format!("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{label}\"><table>{part}");
        }
        wrapped
            .replace("</table>", "</table></div>")
            // A header is for what it names.
            .replace("<th></th>", "<td></td>")
            .replace("<pre>", "<pre tabindex=\"0\">")
    }
}

fn add(page: &mut Page, text: &str) {
    if let Some(section) = page.sections.last_mut() {
        section.text.push_str(text);
    }
}

/// Whether a line of a Rust example is hidden in documentation.
fn is_hidden(line: &str) -> bool {
    let line = line.trim_start();
    line.trim_end() == "#" || line.starts_with("# ")
}

/// The name of a heading in links: lower case, spaces as hyphens, other marks left out.
fn slug(title: &str) -> String {
    title
        .to_lowercase()
        .chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        })
        .collect()
}

/// A second heading of the same name is numbered.
fn distinct(id: String, counts: &mut BTreeMap<String, u32>) -> String {
    let count = counts.entry(id.clone()).or_insert(0);
    *count += 1;
    match *count {
        1 => id,
        count => format!("{id}-{}", count - 1),
    }
}

/// Text as HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
