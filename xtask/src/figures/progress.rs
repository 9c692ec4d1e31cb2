//! Progress on a terminal; nothing elsewhere.

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

/// One bar over all figures, and a line for each that is running.
pub(super) struct Bars {
    all: MultiProgress,
    figures: ProgressBar,
}

/// The line of one running figure.
pub(super) struct Bar<'a> {
    line: ProgressBar,
    bars: &'a Bars,
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Bars {
    pub(super) fn new(figures: u64) -> Self {
        let all = MultiProgress::new();
        let bar = all.add(ProgressBar::new(figures));
        bar.set_style(style("{bar:30} {pos}/{len} figures, {elapsed}"));
        Self { all, figures: bar }
    }

    pub(super) fn start(&self, id: &str) -> Bar<'_> {
        let line = self.all.add(ProgressBar::new_spinner());
        line.set_style(style("  {spinner} {msg} {pos} trials, {elapsed}"));
        line.set_message(id.to_owned());
        line.enable_steady_tick(std::time::Duration::from_millis(200));
        Bar { line, bars: self }
    }

    pub(super) fn clear(&self) {
        self.figures.finish_and_clear();
    }
}

impl Bar<'_> {
    pub(super) fn advance(&self, trials: u64) {
        self.line.inc(trials);
    }

    pub(super) fn finish(self) {
        self.line.finish_and_clear();
        self.bars.figures.inc(1);
    }
}
