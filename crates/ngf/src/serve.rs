//! `ngf serve`: binds the server to an address until it is stopped; with a data folder, it also runs jobs.

use crate::{open_files, token, worker};
use anyhow::Context;
use axum::http::HeaderValue;
use server::scheduler::{JobScheduler, SchedulerConfig};
use server::{AppState, ConnectionLimits, Quotas};
use std::io::{IsTerminal, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Maximum time that running downloads may continue after the stop signal.
const SHUTDOWN_GRACE: Duration = Duration::from_secs(3);

/// Address, folders and quotas of the server.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Address to listen on; any address except loopback needs --token-file
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// File with the bearer token that write requests need (at least 16 characters)
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Also require the token for read requests; the page asks for it
    #[arg(long, requires = "token_file")]
    token_for_reads: bool,
    /// Host name of the server, such as `ngf.example.org`; repeat for more names. Requests for other names are rejected
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// Address of a proxy whose X-Forwarded-For and X-Forwarded-Proto headers are used; repeat for more proxies
    #[arg(long, value_name = "ADDR")]
    trusted_proxy: Vec<IpAddr>,
    /// Port; 0 selects a free port
    #[arg(long, default_value_t = 8787)]
    port: u16,
    /// Folder of the built page
    #[arg(long, value_name = "DIR", default_value = "web/dist")]
    web_dir: PathBuf,
    /// Folder of the models, with one subfolder per model
    #[arg(long, value_name = "DIR", default_value = "models")]
    models_dir: PathBuf,
    /// Model id that `default` refers to and the page loads; may be the model of a job
    #[arg(long, value_name = "ID", default_value = "default")]
    default_model: String,
    /// Folder for jobs and their outputs; without it, jobs are disabled
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Origin of another page that may use the API, such as `https://example.org`; repeat for more origins
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<HeaderValue>,
    /// Maximum write requests per second from one address
    #[arg(long, value_name = "N", default_value_t = Quotas::default().max_writes_per_second)]
    max_writes_per_second: NonZeroU32,
    /// Maximum total size of stored meshes (GB)
    #[arg(long, value_name = "GB", default_value_t = Quotas::default().max_total_mesh_bytes / BYTES_PER_GB)]
    mesh_quota_gb: u64,
    /// Minimum free disk space (GB); below it, jobs and uploads are rejected
    #[arg(long, value_name = "GB", default_value_t = Quotas::default().min_free_bytes / BYTES_PER_GB)]
    min_free_gb: u64,
    /// Format of the log on stderr; the variable NGF_LOG sets the level (info, debug, ...)
    #[arg(long, value_enum, default_value_t = LogFormat::Text)]
    log: LogFormat,
    /// Maximum number of concurrent jobs
    #[arg(long, value_name = "N", default_value_t = 1)]
    max_jobs: usize,
    /// Start without the worker executable while it is being built; jobs wait for it
    #[arg(long)]
    wait_for_worker: bool,
    /// Open the page in a browser
    #[arg(long)]
    open: bool,
}

/// Bytes per gigabyte.
const BYTES_PER_GB: u64 = 1_000_000_000;

/// Log format.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum LogFormat {
    /// Human-readable lines
    Text,
    /// JSON lines
    Json,
}

/// Starts the log on stderr.
fn start_log(log: LogFormat) -> anyhow::Result<()> {
    let filter = EnvFilter::builder()
        .with_env_var("NGF_LOG")
        .with_default_directive(LevelFilter::INFO.into())
        .from_env()
        .context("NGF_LOG is invalid; try NGF_LOG=debug")?;
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    match log {
        LogFormat::Text => subscriber.init(),
        LogFormat::Json => subscriber.json().flatten_event(true).init(),
    }
    Ok(())
}

/// Serves until Ctrl-C or SIGTERM.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    tokio::runtime::Runtime::new()
        .context("cannot start the async runtime")?
        .block_on(serve(options))
}

async fn serve(options: &Options) -> anyhow::Result<()> {
    start_log(options.log)?;
    let socket_addr = SocketAddr::from((options.bind, options.port));
    let token = token::read(options.token_file.as_deref(), options.bind)?;
    let listener = tokio::net::TcpListener::bind(socket_addr).await.with_context(|| {
        format!(
            "cannot listen on {socket_addr}; if the port is in use, choose another one with --port"
        )
    })?;
    let address = format!("http://{}", listener.local_addr()?);
    let (stopping, mut stopped) = tokio::sync::watch::channel(false);
    let engine = open_scheduler(options).await?;
    // Printed only after the data folder is locked, because a reader of the address may rely on it.
    println!("{address}");
    std::io::stdout().flush()?;
    if options.open {
        open_browser(&address);
    }
    let mut state = configure(options, token.as_deref());
    if let Some(engine) = &engine {
        state = state.with_scheduler(engine.clone(), stopped.clone());
    }
    let scheduling = engine.clone().map(|engine| {
        let address = address.clone();
        tokio::spawn(async move { engine.run(&address).await })
    });
    tokio::spawn(async move {
        stop_signal().await;
        stopping.send_replace(true);
    });
    let limits = ConnectionLimits::new(open_files::raise_limit());
    let http_server = server::serve(listener, server::app(state), limits, stopped.clone());
    let mut shutdown_signal = stopped.clone();
    let served = async move {
        let grace_expired = async {
            // An error means that the sender was dropped, so the server has stopped.
            stopped.wait_for(|stopped| *stopped).await.ok();
            tokio::time::sleep(SHUTDOWN_GRACE).await;
        };
        tokio::select! {
            () = http_server => {}
            () = grace_expired => {}
        }
    };
    // Runs to completion even without clients. Dropping a job transition halfway would block the next one.
    let shutdown = async {
        shutdown_signal.wait_for(|stopped| *stopped).await.ok();
        if let Some(scheduling) = &scheduling {
            scheduling.abort();
        }
        if let Some(engine) = &engine {
            engine.shutdown().await;
        }
    };
    tokio::join!(served, shutdown);
    Ok(())
}

/// State of the server without jobs.
fn configure(options: &Options, token: Option<&str>) -> AppState {
    let limits = Quotas {
        max_writes_per_second: options.max_writes_per_second,
        max_total_mesh_bytes: options.mesh_quota_gb.saturating_mul(BYTES_PER_GB),
        min_free_bytes: options.min_free_gb.saturating_mul(BYTES_PER_GB),
        ..Quotas::default()
    };
    let mut state = AppState::new(&options.web_dir, &options.models_dir)
        .with_quotas(limits)
        .with_default_model(&options.default_model)
        .with_host_names(options.host.clone())
        .with_trusted_proxies(options.trusted_proxy.clone())
        .with_origins(options.allow_origin.iter().cloned());
    if let Some(token) = token {
        state = state.with_token(token);
    }
    if options.token_for_reads {
        state = state.with_token_for_reads();
    }
    state
}

/// The job scheduler, if there is a data folder.
async fn open_scheduler(options: &Options) -> anyhow::Result<Option<Arc<JobScheduler>>> {
    let Some(data) = &options.data_dir else { return Ok(None) };
    create_private_dir(data)?;
    token::warn_if_readable(data, "data folder", "logs and weights");
    let config = SchedulerConfig {
        data_dir: data.clone(),
        models_dir: options.models_dir.clone(),
        program: if options.wait_for_worker { worker::path()? } else { worker::executable()? },
        waits_for_program: options.wait_for_worker,
        max_concurrent: options.max_jobs,
        min_free_bytes: options.min_free_gb.saturating_mul(BYTES_PER_GB),
    };
    Ok(Some(JobScheduler::open(config).await?))
}

/// Creates the data folder, readable only by its owner.
fn create_private_dir(path: &Path) -> anyhow::Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path).with_context(|| format!("cannot create {}", path.display()))
}

/// Resolves at Ctrl-C, and on Unix at SIGTERM.
async fn stop_signal() {
    let interrupt = tokio::signal::ctrl_c();
    #[cfg(unix)]
    if let Ok(mut terminate) =
        tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())
    {
        tokio::select! {
            _ = interrupt => {}
            _ = terminate.recv() => {}
        }
        return;
    }
    interrupt.await.ok();
}

/// Opens the page if a desktop is available. The address has been printed already.
fn open_browser(address: &str) {
    let has_desktop = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|v| std::env::var_os(v).is_some());
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(windows) {
        Command::new("explorer")
    } else if has_desktop {
        Command::new("xdg-open")
    } else {
        return;
    };
    let silent = command.arg(address).stdin(Stdio::null()).stdout(Stdio::null());
    // The server runs even if no browser can be opened.
    silent.stderr(Stdio::null()).spawn().ok();
}
