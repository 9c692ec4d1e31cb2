//! `index.html`: the state of this run, failures first; figures of earlier runs stand greyed behind it.

use super::draw::typeset;
use super::record::{Judged, Record};
use fewbits_experiments::{Verdict, plain};
use maud::{DOCTYPE, Markup, PreEscaped, html};
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

/// The page over all records of a directory, of which `this_run` were made now; `note` says what a reader must know first.
pub(super) fn page<'a>(records: impl Iterator<Item = &'a Record>, this_run: &BTreeSet<String>, note: &str) -> String {
    let mut records: Vec<(Standing, &Record)> = records.map(|r| (Standing::of(r, this_run), r)).collect();
    records.sort_by_key(|(standing, _)| *standing);
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
                    form role="search" aria-label="Choose figures" {
                        label { "Search " input id="search" type="search" placeholder="id, title, claim"; }
                        label { "System "
                            select id="system" { option value="" { "all" } @for s in &systems { option { (s) } } }
                        }
                        label { "Verdict "
                            select id="verdict" {
                                option value="" { "all" }
                                @for s in [Standing::Failed, Standing::Passed, Standing::Earlier] { option value=(s.word()) { (s.word()) } }
                            }
                        }
                        output id="shown" aria-live="polite" {}
                    }
                    nav aria-label="Figures" { ul {
                        @for (standing, r) in &records {
                            li data-figure=(r.id) { a class=(standing.word()) href={ "#" (r.id) } { (r.id) } " " small { (tally(r)) } }
                        }
                    } }
                }
                main id="figures" { @for (standing, r) in &records { (figure(*standing, r)) } }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
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
        notices
            .push(format!("{earlier} figures were not run this time; they stand greyed at the end, with their date."));
    }
    notices
}

fn tally(record: &Record) -> String {
    if record.error.is_some() {
        return "not made".to_owned();
    }
    match record.count(Verdict::Fail) {
        0 => format!("{} hold", record.count(Verdict::Pass)),
        fail => format!("{fail} fail"),
    }
}

fn figure(standing: Standing, r: &Record) -> Markup {
    let (failing, other): (Vec<_>, Vec<_>) = r.claims.iter().partition(|c| c.verdict == Verdict::Fail);
    let skipped = r.count(Verdict::Skipped);
    let downloads = r.files.iter().cloned().chain([format!("{}.json", r.id)]);
    html! {
        article id=(r.id) class=(standing.word()) data-system=(r.system()) aria-labelledby={ (r.id) "-title" } {
            h2 id={ (r.id) "-title" } { (typeset(&r.title)) " " small { (r.id) } }
            p.standing {
                span class={ "badge " (standing.word()) } { (standing.word()) }
                @if r.quick { " " span.badge { "quick" } }
                @if standing == Standing::Earlier { " not run this time; made " (r.finished) " at commit " (r.commit) }
            }
            @if let Some(error) = &r.error { p.notice { "Not made: " (error) } }
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
                        summary { "Parameters" }
                        dl {
                            @for (name, value) in &r.parameters { dt { (name) } dd { (plain(value)) } }
                            dt { "seed" } dd { (r.seed) }
                        }
                        p { small { "Version " (r.version) ", commit " (r.commit) ", " (r.finished) ", " (format!("{:.2}", r.wall_time_s)) " s." } }
                    }
                    p.downloads { "Download: " @for name in downloads { a href=(name) download { (name) } " " } }
                }
            }
        }
    }
}

fn claims(claims: &[&Judged]) -> Markup {
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
                            td.number { (c.measured()) }
                            td.number { (c.expectation()) }
                        }
                    }
                }
            }
        }
    }
}
