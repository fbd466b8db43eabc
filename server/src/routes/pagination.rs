//! Cursor pagination of lists.

use crate::Problem;
use crate::extract::Parameters;
use crate::jobs::scheduler::JobScheduler;
use crate::store::RecordKind;
use axum::Json;
use serde_json::{Value, json};
use utoipa::ToSchema;

/// Page of a list.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct Page<T> {
    /// Type of this object: always `list`.
    object: String,
    data: Vec<T>,
    /// Whether more entries follow.
    has_more: bool,
}

/// Page of a list, with the ids of its first and last entry.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
pub(super) struct CursorPage<T> {
    #[serde(flatten)]
    page: Page<T>,
    /// Id of the first entry; null if the page is empty.
    first_id: Option<String>,
    /// Id of the last entry; null if the page is empty.
    last_id: Option<String>,
}

/// Default number of entries per page.
pub(super) const DEFAULT_LIMIT: i64 = 20;
/// Maximum number of entries per page.
const MAX_LIMIT: i64 = 100;

/// Parses the query parameter `limit`.
pub(super) fn parse_limit(text: &str) -> Result<i64, Problem> {
    match text.parse() {
        Ok(limit) if (1..=MAX_LIMIT).contains(&limit) => Ok(limit),
        _ => Err(Problem::invalid_parameter(
            "limit",
            format!("must be a number from 1 to {MAX_LIMIT}"),
        )),
    }
}

/// List response with records of a kind, newest first; query parameters `after` and `limit`.
pub(super) async fn list_records(
    scheduler: &JobScheduler,
    kind: RecordKind,
    parameters: Parameters,
) -> Result<Json<Value>, Problem> {
    let query = parameters.only(&["after", "limit"])?;
    let limit = query.get("limit").map_or(Ok(DEFAULT_LIMIT), |text| parse_limit(text))?;
    let (data, has_more) = page_of_records(scheduler, kind, query.get("after"), limit).await?;
    Ok(Json(json!({ "object": "list", "data": data, "has_more": has_more })))
}

/// Up to `limit` records after the id `after`, and whether more follow.
pub(super) async fn page_of_records(
    scheduler: &JobScheduler,
    kind: RecordKind,
    after: Option<&String>,
    limit: i64,
) -> Result<(Vec<Value>, bool), Problem> {
    if let Some(after) = after
        && scheduler.store.record(kind, after).await?.is_none()
    {
        let reason = format!("no {} has this id; restart from the first page", kind.name());
        return Err(Problem::invalid_parameter("after", reason));
    }
    let after = after.map(String::as_str);
    let mut records = scheduler.store.records(kind, after, limit + 1).await?;
    let has_more = records.len() as i64 > limit;
    records.truncate(limit as usize);
    Ok((records, has_more))
}
