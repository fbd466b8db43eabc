//! Lists, page by page.

use crate::Problem;
use crate::engine::Engine;
use crate::store::RecordKind;
use axum::Json;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A page of a list.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Page<T> {
    /// Always `list`.
    object: String,
    data: Vec<T>,
    /// Whether there are more after these.
    has_more: bool,
}

/// A page of a list, with the ids at its ends.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Stretch<T> {
    #[serde(flatten)]
    page: Page<T>,
    /// Id of the first one here; null if there is none.
    first_id: Option<String>,
    /// Id of the last one here; null if there is none.
    last_id: Option<String>,
}

/// Entries of a page, if nothing is said.
pub(super) const STANDARD_LIMIT: i64 = 20;
/// Entries of a page at most.
const MOST_LIMIT: i64 = 100;

/// The length of a list.
pub(super) fn limit(text: &str) -> Result<i64, Problem> {
    match text.parse() {
        Ok(limit) if (1..=MOST_LIMIT).contains(&limit) => Ok(limit),
        _ => Err(Problem::invalid("limit", format!("it is a number from 1 to {MOST_LIMIT}"))),
    }
}

/// Records of a kind, newest first: those after `after`, `limit` of them.
pub(super) async fn records(
    engine: &Engine,
    kind: RecordKind,
    query: &BTreeMap<String, String>,
) -> Result<Json<Value>, Problem> {
    let asked = query.get("limit").map_or(Ok(STANDARD_LIMIT), |text| limit(text))?;
    let (data, has_more) = page(engine, kind, query.get("after"), asked).await?;
    Ok(Json(json!({ "object": "list", "data": data, "has_more": has_more })))
}

/// A page of records, and whether there are more.
pub(super) async fn page(
    engine: &Engine,
    kind: RecordKind,
    after: Option<&String>,
    asked: i64,
) -> Result<(Vec<Value>, bool), Problem> {
    if let Some(after) = after
        && engine.store.record(kind, after).await?.is_none()
    {
        let why = format!("there is no {} of this id, or no longer; begin anew", kind.name());
        return Err(Problem::invalid("after", why));
    }
    let after = after.map(String::as_str);
    let mut records = engine.store.records(kind, after, asked + 1).await?;
    let has_more = records.len() as i64 > asked;
    records.truncate(asked as usize);
    Ok((records, has_more))
}
