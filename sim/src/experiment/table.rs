//! Tables, as CSV.

use std::fmt::Display;

/// A table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// Its file's name, without ending.
    pub name: &'static str,
    /// The columns' names.
    pub header: Vec<String>,
    /// The rows, each as long as the header.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(name: &'static str, header: &[&str]) -> Self {
        let header = header.iter().map(|&column| column.to_owned()).collect();
        Self { name, header, rows: Vec::new() }
    }

    /// Adds a row.
    pub fn push(&mut self, row: &[&dyn Display]) {
        self.rows.push(row.iter().map(ToString::to_string).collect());
    }

    /// The table as CSV; no cell holds a comma, a quote or a line's end.
    #[must_use]
    pub fn csv(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows);
        lines.map(|line| line.join(",") + "\n").collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv() {
        let mut table = Table::new("t", &["a", "b"]);
        table.push(&[&1, &"x"]);
        table.push(&[&2.5, &"y"]);
        assert_eq!(table.csv(), "a,b\n1,x\n2.5,y\n");
    }
}
