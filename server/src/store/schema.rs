//! Schema of the database: migrations, and a check of their result.

use super::StoreError;
use sqlx::SqlSafeStr;
use sqlx::migrate::{MigrateError, Migration, MigrationType, Migrator};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool, SqlitePoolOptions};
use std::collections::BTreeSet;

/// Descriptions and texts of the migrations, in the order of their versions, from 1. Databases of earlier
/// versions contain the tables of the first one already.
const MIGRATIONS: [(&str, &str); 4] = [
    ("tables", include_str!("../../migrations/0001_tables.sql")),
    ("lists", include_str!("../../migrations/0002_lists.sql")),
    ("metric_chunks", include_str!("../../migrations/0003_metric_chunks.sql")),
    ("readiness", include_str!("../../migrations/0004_readiness.sql")),
];

/// The migrations. The macro `sqlx::migrate!` would compile SQLite a second time, for the build host.
fn migrator() -> Migrator {
    let migration = |(version, (name, text)): (i64, &(&'static str, &'static str))| {
        Migration::new(version, (*name).into(), MigrationType::Simple, text.into_sql_str(), false)
    };
    Migrator::with_migrations((1..).zip(&MIGRATIONS).map(migration).collect())
}

/// Updates a database to the current schema. Rejects databases of newer versions, and damaged ones.
pub(super) async fn migrate(pool: &SqlitePool) -> Result<(), StoreError> {
    migrator().run(pool).await.map_err(|error| match error {
        MigrateError::VersionMissing(version) => StoreError::Newer(version, MIGRATIONS.len()),
        other => StoreError::Migration(other),
    })?;
    let memory = SqliteConnectOptions::new().in_memory(true);
    let expected = SqlitePoolOptions::new().max_connections(1).connect_with(memory).await?;
    migrator().run(&expected).await.map_err(StoreError::Migration)?;
    let (expected, actual) = (columns(&expected).await?, columns(pool).await?);
    let missing: Vec<&str> = expected.difference(&actual).map(String::as_str).collect();
    if missing.is_empty() { Ok(()) } else { Err(StoreError::MissingColumns(missing.join(", "))) }
}

/// Columns of all tables, as `TABLE.COLUMN`.
async fn columns(pool: &SqlitePool) -> Result<BTreeSet<String>, StoreError> {
    let names: Vec<String> = sqlx::query_scalar(
        "SELECT tables.name || '.' || columns.name
         FROM sqlite_schema AS tables JOIN pragma_table_xinfo(tables.name) AS columns
         WHERE tables.type = 'table'",
    )
    .fetch_all(pool)
    .await?;
    Ok(names.into_iter().collect())
}
