//! Lists of jobs, by filter and page.

use super::damage::{DAMAGED, parse_listed};
use super::{Store, StoreError};
use crate::jobs::{Job, Kind, Status};
use sqlx::AssertSqlSafe;

/// Filter and page of a job list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filter {
    /// Accepted statuses; empty accepts all.
    pub(crate) status: Vec<Status>,
    /// Accepted kinds; empty accepts all.
    pub(crate) kind: Vec<Kind>,
    /// Required metadata entries.
    pub(crate) metadata: Vec<(String, String)>,
    /// Id of the last job of the previous page.
    pub(crate) after: Option<String>,
    /// Ascending order of creation; the default is descending.
    pub(crate) oldest_first: bool,
    /// Maximum number of jobs.
    pub(crate) limit: i64,
}

impl Filter {
    /// Query for the ids and records of the jobs, and the values of its placeholders.
    ///
    /// The inner query finds the ids of the page in one narrow index, in order: `jobs_by_id`, or the primary
    /// key of `job_metadata` for the first metadata entry. Only the records of the page are read.
    fn query(&self) -> (String, Vec<&str>) {
        let placeholders = |count: usize| vec!["?"; count].join(", ");
        let (mut conditions, mut values) = (vec!["entry.status <> ?".to_owned()], vec![DAMAGED]);
        let mut metadata = self.metadata.iter();
        let (source, id) = match metadata.next() {
            None => ("jobs AS entry INDEXED BY jobs_by_id", "entry.id"),
            Some((key, value)) => {
                conditions.push("entry.key = ? AND entry.value = ?".into());
                values.extend([key.as_str(), value.as_str()]);
                ("job_metadata AS entry", "entry.job")
            }
        };
        for (key, value) in metadata {
            let other =
                "SELECT 1 FROM job_metadata WHERE key = ? AND value = ? AND job = entry.job";
            conditions.push(format!("EXISTS ({other})"));
            values.extend([key.as_str(), value.as_str()]);
        }
        if !self.status.is_empty() {
            conditions.push(format!("entry.status IN ({})", placeholders(self.status.len())));
            values.extend(self.status.iter().map(|status| status.name()));
        }
        if !self.kind.is_empty() {
            conditions.push(format!("entry.kind IN ({})", placeholders(self.kind.len())));
            values.extend(self.kind.iter().map(|kind| kind.name()));
        }
        let (sign, order) = if self.oldest_first { (">", "ASC") } else { ("<", "DESC") };
        if let Some(after) = &self.after {
            conditions.push(format!("{id} {sign} ?"));
            values.push(after);
        }
        let conditions = conditions.join(" AND ");
        let page =
            format!("SELECT {id} FROM {source} WHERE {conditions} ORDER BY {id} {order} LIMIT ?");
        (format!("SELECT id, record FROM jobs WHERE id IN ({page}) ORDER BY id {order}"), values)
    }
}

impl Store {
    /// Jobs that match a filter, newest first by default; damaged ones are omitted.
    pub(crate) async fn jobs(&self, filter: &Filter) -> Result<Vec<Job>, StoreError> {
        let (text, values) = filter.query();
        // The text contains no caller input; all values are bound.
        let mut query = sqlx::query_as::<_, (String, String)>(AssertSqlSafe(text));
        for value in values {
            query = query.bind(value);
        }
        let records = query.bind(filter.limit).fetch_all(&self.readers).await?;
        Ok(records.into_iter().filter_map(parse_listed).collect())
    }
}
