//! Tables for values of the report's JSON without a section of their own.
//!
//! A count stays a whole number, other numbers get three digits. A list of objects becomes a table
//! with a column for each key, an object a table of two columns.

use maud::{Markup, html};
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::table::{Table, cells, typeset};
use scarab_identify::report::RunReport;
use serde_json::{Map, Value};

use crate::view::html::number;
use crate::view::html::table::{ToHtml, html_cell};

/// Limit of nesting on the page.
const DEEPEST: usize = 3;

/// Sections of findings in the samples and of a board's trace; empty ones are omitted.
pub(crate) fn sections(run: &RunReport) -> Result<Markup, ToolError> {
    let values =
        [("samples", serde_json::to_value(&run.samples)), ("trace", serde_json::to_value(&run.trace))];
    let mut sections = Vec::new();
    for (name, value) in values {
        let value =
            value.map_err(|error| ToolError::input(format!("the report cannot be shown: {error}")))?;
        sections.extend((!is_empty(&value)).then(|| section(name, &value)));
    }
    Ok(html! { @for section in &sections { (section) } })
}

fn is_empty(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(items) => items.is_empty(),
        Value::Object(keys) => keys.values().all(is_empty),
        _ => false,
    }
}

/// Title of a key: `model_choice` becomes `Model choice`, `longest_s` becomes `Longest, s`.
pub(crate) fn words(key: &str) -> String {
    let units =
        [("_s", ", s"), ("_nm", ", N m"), ("_deg", ", deg"), ("_kg", ", kg"), ("_m", ", m"), ("_hz", ", Hz")];
    let (stem, unit) =
        units.iter().find_map(|(ending, unit)| Some((key.strip_suffix(ending)?, *unit))).unwrap_or((key, ""));
    let mut words = stem.replace('_', " ");
    if let Some(first) = words.get(..1).map(str::to_uppercase) {
        words.replace_range(..1, &first);
    }
    words + unit
}

/// Section of one key.
fn section(name: &str, value: &Value) -> Markup {
    html! { section { h2 { (words(name)) } (content(value, 0)) } }
}

/// Formats any value.
pub(crate) fn content(value: &Value, depth: usize) -> Markup {
    match value {
        Value::Array(items) if depth < DEEPEST && items.iter().any(Value::is_object) => rows(items, depth),
        Value::Object(keys) if depth < DEEPEST => {
            let mut table = Table::with_class("any").label("").text([""]);
            keys.iter()
                .for_each(|(key, value)| table.row(cells![words(key), html_cell(content(value, depth + 1))]));
            table.to_html()
        }
        Value::Object(_) => html! { (value.to_string()) },
        Value::Array(items) => html! {
            @for (index, item) in items.iter().enumerate() {
                @if index > 0 { ", " }
                (content(item, DEEPEST))
            }
        },
        Value::Number(value) if value.is_f64() => html! { (number(Number(value.as_f64()))) },
        Value::Number(count) => html! { (typeset(&count.to_string())) },
        Value::String(text) => html! { (text) },
        Value::Bool(true) => html! { "yes" },
        Value::Bool(false) => html! { "no" },
        Value::Null => html! { "\u{2013}" },
    }
}

/// Table with a column for each key of any item.
fn rows(items: &[Value], depth: usize) -> Markup {
    let mut columns: Vec<&str> = Vec::new();
    for key in items.iter().filter_map(Value::as_object).flat_map(Map::keys) {
        if !columns.contains(&key.as_str()) {
            columns.push(key);
        }
    }
    let is_number =
        |column: &str| items.iter().all(|item| item.get(column).is_none_or(|v| v.is_number() || v.is_null()));
    let mut table = columns.iter().fold(Table::with_class("any"), |table, column| match is_number(column) {
        true => table.numbers([words(column)]),
        false => table.text([words(column)]),
    });
    for item in items {
        let cell = |column: &&str| html_cell(content(item.get(*column).unwrap_or(&Value::Null), depth + 1));
        table.row(columns.iter().map(cell));
    }
    table.to_html()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn an_unknown_key_is_shown_with_names_units_and_numbers() {
        let value = json!({"replaced": [3, 0], "longest_s": 0.25, "joints": [{"joint": 1, "note": "<b>"}, {"joint": 2}]});
        let shown = section("outliers", &value).into_string();
        for part in ["<h2>Outliers</h2>", "Longest, s", "0.250", "3, 0", ">1<", "&lt;b&gt;", "\u{2013}"] {
            assert!(shown.contains(part), "{part}: {shown}");
        }
        assert!(!shown.contains("<b>"));
    }

    #[test]
    fn empty_values_are_omitted() {
        assert!(is_empty(&json!({"a": [], "b": null})) && !is_empty(&json!({"a": false})));
    }
}
