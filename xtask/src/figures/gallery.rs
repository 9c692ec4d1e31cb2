//! `index.html`: the state of this run, failures first, then the systems in the order of the publications. Figures of earlier
//! runs stand greyed at the end of their system.

use super::record::{Record, expectation, measured};
use fewbits_experiments::{Claim, Verdict, plain};
use fewbits_plot::typeset;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value as Json;
use std::collections::BTreeSet;

const STYLE: &str = include_str!("gallery.css");
const SCRIPT: &str = include_str!("gallery.js");

/// How a figure stands in the gallery.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Standing {
    Failed,
    Passed,
    Earlier,
}

impl Standing {
    fn of(record: &Record, this_run: &BTreeSet<String>) -> Self {
        match (this_run.contains(&record.id), record.good()) {
            (false, _) => Self::Earlier,
            (true, true) => Self::Passed,
            (true, false) => Self::Failed,
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Passed => "passed",
            Self::Earlier => "earlier",
        }
    }
}

/// Systems in the order of the publications, then ours, with their headings.
const SYSTEMS: [(&str, &str); 12] = [
    ("dymbo", "Dymbo: one bit per sample"),
    ("cfwmd", "CFwMD: censored measurements"),
    ("mi", "Quantizers designed by mutual information"),
    ("binary", "Binary patterns"),
    ("assign", "Which bit to ask of which sensor"),
    ("mpa", "Tracking from quantized ranges"),
    ("handoff", "Compressed hand-off"),
    ("diffusive", "A diffusive source"),
    ("network", "The simulated network"),
    ("real", "Recorded signals"),
    ("problems", "Curved models and two bits"),
    ("targets", "Several targets"),
];

/// Figures under one heading.
struct Section<'a> {
    id: &'a str,
    title: &'a str,
    figures: Vec<(Standing, &'a Record)>,
}

/// What failed in this run, then each system with its figures in their order; those of earlier runs last.
fn sections<'a>(records: impl Iterator<Item = &'a Record>, this_run: &BTreeSet<String>) -> Vec<Section<'a>> {
    let order = fewbits_experiments::ids();
    let place = |r: &Record| order.iter().position(|id| *id == r.id).unwrap_or(order.len());
    let mut records: Vec<(Standing, &Record)> = records.map(|r| (Standing::of(r, this_run), r)).collect();
    records.sort_by_key(|(standing, r)| (*standing == Standing::Earlier, place(r)));
    let (failed, others): (Vec<_>, Vec<_>) = records.into_iter().partition(|(s, _)| *s == Standing::Failed);
    let mut sections = vec![Section {
        id: "failed",
        title: "Failed in this run",
        figures: failed,
    }];
    for (id, title) in SYSTEMS {
        let figures = others.iter().copied().filter(|(_, r)| r.system() == id).collect();
        sections.push(Section { id, title, figures });
    }
    let known = |r: &Record| SYSTEMS.iter().any(|(id, _)| *id == r.system());
    sections.push(Section {
        id: "others",
        title: "Others",
        figures: others.iter().copied().filter(|(_, r)| !known(r)).collect(),
    });
    sections.retain(|section| !section.figures.is_empty());
    sections
}

/// The page over all records of a directory, of which `this_run` were made now; `note` says what a reader must know first.
pub(super) fn page<'a>(records: impl Iterator<Item = &'a Record>, this_run: &BTreeSet<String>, note: &str) -> String {
    let sections = sections(records, this_run);
    let records: Vec<(Standing, &Record)> = sections.iter().flat_map(|s| &s.figures).copied().collect();
    let now = || {
        records
            .iter()
            .filter(|(standing, _)| *standing != Standing::Earlier)
            .map(|(_, r)| *r)
    };
    let total = |verdict| now().map(|r| r.count(verdict)).sum::<usize>();
    let broken = now().filter(|r| r.error.is_some()).count();
    let systems: BTreeSet<&str> = records.iter().map(|(_, r)| r.system()).collect();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "fewbits: figures and their claims" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                a.skip href="#figures" { "Skip to the figures" }
                header {
                    h1 { "fewbits: figures and their claims" }
                    p {
                        "This run: " (now().count()) " figures, " strong { (total(Verdict::Pass)) } " claims hold, "
                        strong.fail[total(Verdict::Fail) > 0] { (total(Verdict::Fail)) } " fail, "
                        (total(Verdict::Skipped)) " skipped"
                        @if broken > 0 { ", " strong.fail { (broken) " figures could not be made" } }
                        "."
                    }
                    @if !note.is_empty() { p.notice { (note) } }
                    @for notice in notices(&records) { p.notice { (notice) } }
                    details.index {
                        summary { "Find a figure" }
                        form role="search" aria-label="Choose figures" {
                            label { "Search " input id="search" type="search" placeholder="id, title, claim"; }
                            label { "System "
                                select id="system" { option value="" { "all" } @for s in &systems { option { (s) } } }
                            }
                            label { "Source "
                                select id="source" {
                                    option value="" { "all" }
                                    option value="paper" { "publications" }
                                    option value="ours" { "ours" }
                                }
                            }
                            label { "Verdict "
                                select id="verdict" {
                                    option value="" { "all" }
                                    @for s in [Standing::Failed, Standing::Passed, Standing::Earlier] { option value=(s.word()) { (s.word()) } }
                                }
                            }
                            output id="shown" aria-live="polite" {}
                        }
                        nav aria-label="Figures" { @for section in &sections { (index(section)) } }
                    }
                }
                main id="figures" {
                    @for section in &sections {
                        section.system data-section=(section.id) {
                            h2 { (section.title) }
                            @for (standing, r) in &section.figures { (figure(*standing, r)) }
                        }
                    }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// A section's figures as small pictures with titles.
fn index(section: &Section<'_>) -> Markup {
    html! {
        h2 { (section.title) }
        ul {
            @for (standing, r) in &section.figures {
                li data-figure=(r.id) {
                    a class=(standing.word()) href={ "#" (r.id) } {
                        @if let Some(svg) = r.files.iter().find(|name| name.ends_with(".svg")) {
                            img src=(svg) alt="" loading="lazy" decoding="async";
                        }
                        (typeset(&r.title))
                    }
                    small { (r.id) ", " (tally(r)) }
                }
            }
        }
    }
}

/// What differs between the figures on the page, and so forbids to read them as one run.
fn notices(records: &[(Standing, &Record)]) -> Vec<String> {
    let kinds = |of: fn(&Record) -> String| records.iter().map(|(_, r)| of(r)).collect::<BTreeSet<_>>();
    let (seeds, commits) = (kinds(|r| r.seed.to_string()), kinds(|r| r.commit.clone()));
    let listed = |set: BTreeSet<String>| set.into_iter().collect::<Vec<_>>().join(", ");
    let earlier = records
        .iter()
        .filter(|(standing, _)| *standing == Standing::Earlier)
        .count();
    let quick = records.iter().filter(|(_, r)| r.quick).count();
    let mut notices = Vec::new();
    if seeds.len() > 1 {
        notices.push(format!("These figures come from different seeds: {}.", listed(seeds)));
    }
    if commits.len() > 1 {
        notices.push(format!("These figures come from different commits: {}.", listed(commits)));
    }
    if quick > 0 {
        notices.push(format!(
            "{quick} figures are quick ones, with reduced effort: claims that need all of it are skipped."
        ));
    }
    if earlier > 0 {
        notices.push(format!(
            "{earlier} figures were not run this time; they stand greyed behind the others, with their date."
        ));
    }
    notices
}

fn tally(record: &Record) -> String {
    if record.error.is_some() {
        return "not made".to_owned();
    }
    match record.count(Verdict::Fail) {
        0 if record.is_undecided() => "undecided".to_owned(),
        0 => format!("{} hold", record.count(Verdict::Pass)),
        fail => format!("{fail} fail"),
    }
}

fn figure(standing: Standing, r: &Record) -> Markup {
    let (failing, other): (Vec<_>, Vec<_>) = r.claims.iter().partition(|c| c.verdict == Verdict::Fail);
    let skipped = r.count(Verdict::Skipped);
    let downloads = r.files.iter().cloned().chain([format!("{}.json", r.id)]);
    html! {
        @let origin = if r.source.is_empty() { "ours" } else { "paper" };
        article id=(r.id) class=(standing.word()) data-system=(r.system()) data-source=(origin) aria-labelledby={ (r.id) "-title" } {
            h3 id={ (r.id) "-title" } { (typeset(&r.title)) " " small { (r.id) } }
            p.standing {
                span class={ "badge " (standing.word()) } { (standing.word()) }
                @if r.quick { " " span.badge { "quick" } }
                @if standing == Standing::Earlier { " not run this time; made " (r.finished) " at commit " (r.commit) }
            }
            @if let Some(error) = &r.error { p.notice { "Not made: " (error) } }
            @if r.is_undecided() { p.notice { "None of its claims was decided." } }
            div.columns {
                figure {
                    @for svg in r.files.iter().filter(|name| name.ends_with(".svg")) {
                        a href=(svg) { img src=(svg) alt={ "Plot: " (r.title) } loading="lazy"; }
                    }
                    figcaption { (typeset(&r.caption)) @if !r.source.is_empty() { " " cite { (r.source) } } }
                }
                section aria-label={ "Claims of " (r.id) } {
                    @if !failing.is_empty() { (claims(&failing)) }
                    @if !other.is_empty() {
                        details {
                            summary { (other.len() - skipped) " claims hold" @if skipped > 0 { ", " (skipped) " skipped" } }
                            (claims(&other))
                        }
                    }
                    details {
                        summary { "Command and parameters" }
                        pre { code { (r.command()) } }
                        dl {
                            @for (name, value) in &r.parameters { dt { (name) } dd { (plain(value)) } }
                            dt { "seed" } dd { (r.seed) }
                        }
                        p { small { "Version " (r.version) ", commit " (r.commit) ", " (r.finished) ", " (format!("{:.2}", r.wall_time_s)) " s." } }
                    }
                    @for (name, columns) in &r.columns { (columns_of(name, columns)) }
                    p.downloads { "Download: " @for name in downloads { a href=(name) download { (name) } " " } }
                }
            }
        }
    }
}

/// The columns of one CSV file with their units and meanings.
fn columns_of(name: &str, columns: &Json) -> Markup {
    let text = |column: &Json, key: &str| column[key].as_str().unwrap_or_default().to_owned();
    let columns = columns.as_array().map_or(&[][..], Vec::as_slice);
    html! {
        details {
            summary { "Columns of " (name) }
            div.scroll tabindex="0" role="region" aria-label={ "Columns of " (name) } {
                table {
                    thead { tr { th scope="col" { "column" } th scope="col" { "unit" } th scope="col" { "meaning" } } }
                    tbody {
                        @for column in columns {
                            tr { td { code { (text(column, "name")) } } td { (typeset(&text(column, "unit"))) } td { (typeset(&text(column, "meaning"))) } }
                        }
                    }
                }
            }
        }
    }
}

fn claims(claims: &[&Claim]) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label="Claims" {
            table {
                thead { tr { th scope="col" { "verdict" } th scope="col" { "claim" } th scope="col" { "measured" } th scope="col" { "expected" } } }
                tbody {
                    @for c in claims {
                        tr {
                            @let verdict = match c.verdict { Verdict::Pass => "pass", Verdict::Fail => "fail", Verdict::Skipped => "skipped" };
                            td class=(verdict) { (verdict) }
                            td { (typeset(&c.statement)) " " small { (c.id) } }
                            td.number { (measured(c)) }
                            td.number { (expectation(c)) }
                        }
                    }
                }
            }
        }
    }
}
