//! One self-contained HTML page of everything that was found.

use super::calibrator::Phase;
use super::machine::Machine;
use super::plan::Plan;
use super::{Report, Shown};

const STYLE: &str = "body{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em;\
    line-height:1.5}figure{margin:2em 0}figure svg{max-width:100%;height:auto}\
    table{border-collapse:collapse}th,td{padding:.2em .8em;text-align:right;\
    border-bottom:1px solid #ccc}.paper{color:#555}";

/// The page of some reports.
pub(super) fn page(machine: &Machine, plan: &Plan, reports: &[Report]) -> String {
    let body: String = reports.iter().map(section).collect();
    let machine = escaped(&machine.to_string());
    let seed = plan.seed;
    let (gain, ping_pong) = (Phase::LEAST_GAIN, Phase::WORST_PING_PONG);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <title>dualframe: experiments</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <h1>dualframe: experiments</h1>\n\
         <p>{machine}; seed {seed}. Medians of interleaved rounds, where nothing else is said. A round is marked \
         when two independent threads gain less than {gain} over one, or a ping-pong between them takes more \
         than {ping_pong} times what is usual: something else was running, or there are no two whole cores. That says \
         nothing of further cores. Marked rounds are in the CSV \
         files. The paper's values are those of a 6-core Intel i7-980X.</p>\n{body}</body>\n</html>\n"
    )
}

fn section(report: &Report) -> String {
    let mut section = String::new();
    for figure in &report.figures {
        let (title, svg) = (escaped(&figure.title), drawing(&figure.svg));
        let (finding, paper) = (escaped(&figure.finding), escaped(figure.paper));
        section += &format!(
            "<figure id=\"{}\">\n<h2>{title}</h2>\n{svg}\n<figcaption>{finding}<br>\
             <span class=\"paper\">Paper: {paper}</span></figcaption>\n</figure>\n",
            figure.name
        );
    }
    section + &report.shown.as_ref().map(html).unwrap_or_default()
}

/// A figure's `svg` element, without what only a file of its own needs.
fn drawing(svg: &str) -> &str {
    svg.find("<svg").map_or(svg, |start| &svg[start..])
}

fn html(Shown { title, table, paper }: &Shown) -> String {
    let row = |cells: &Vec<String>, tag: &str| {
        let cells: String =
            cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
    let (title, header) = (escaped(title), row(&table.header, "th"));
    let paper = escaped(paper);
    format!(
        "<h2>{title}</h2>\n<table>\n{header}{rows}</table>\n\
         <p class=\"paper\">Paper: {paper}</p>\n"
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
