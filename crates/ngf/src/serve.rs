//! `ngf serve`: binds the server to an address until it is told to stop; with a folder for data, it does jobs.

use anyhow::{Context, bail};
use axum::http::HeaderValue;
use server::engine::{Engine, EngineConfig};
use server::{AppState, Limits};
use std::io::{IsTerminal, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Downloads still running when the server is told to stop may take this long.
const GRACE: Duration = Duration::from_secs(3);

/// Characters of a token, at least.
const SHORTEST_TOKEN: usize = 16;

/// Where to listen and what to serve.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Address to listen on; any but the loopback one needs --token-file.
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// File with the token that changes need: 16 characters at least.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Port; 0 takes any free one.
    #[arg(long, default_value_t = 8787)]
    port: u16,
    /// Folder of the built page.
    #[arg(long, value_name = "DIR", default_value = "web/dist")]
    web: PathBuf,
    /// Folder of the models, one folder each.
    #[arg(long, value_name = "DIR", default_value = "models")]
    models: PathBuf,
    /// Id of the model that the page opens and `default` stands for; a job's, too.
    #[arg(long, value_name = "ID", default_value = "default")]
    default_model: String,
    /// Folder of jobs and what comes of them; without it, the server does none.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Origin of a page that may use the API, too, as `https://example.org`; again for more.
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<HeaderValue>,
    /// Changes that one address may ask for in a second.
    #[arg(long, value_name = "N", default_value_t = Limits::default().changes_per_second)]
    rate: NonZeroU32,
    /// Gigabytes of meshes that are kept.
    #[arg(long, value_name = "GB", default_value_t = Limits::default().kept_mesh_bytes / GB)]
    meshes: u64,
    /// Gigabytes of the disk that stay free.
    #[arg(long, value_name = "GB", default_value_t = Limits::default().free_bytes / GB)]
    free: u64,
    /// How the log on stderr is written; the variable NGF_LOG says how much of it (info, debug, ...).
    #[arg(long, value_enum, default_value_t = Log::Text)]
    log: Log,
    /// Jobs at a time.
    #[arg(long, value_name = "N", default_value_t = 1)]
    places: usize,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
}

/// A gigabyte.
const GB: u64 = 1_000_000_000;

/// How the log is written.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Log {
    /// Lines for people.
    Text,
    /// Lines of JSON.
    Json,
}

/// Says on stderr what happens.
fn begin_log(log: Log) -> anyhow::Result<()> {
    let filter = EnvFilter::builder()
        .with_env_var("NGF_LOG")
        .with_default_directive(LevelFilter::INFO.into())
        .from_env()
        .context("NGF_LOG cannot be read; try NGF_LOG=debug")?;
    let log_to = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    match log {
        Log::Text => log_to.init(),
        Log::Json => log_to.json().flatten_event(true).init(),
    }
    Ok(())
}

/// Serves until Ctrl-C or SIGTERM.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    tokio::runtime::Runtime::new().context("no runtime")?.block_on(serve(options))
}

async fn serve(options: &Options) -> anyhow::Result<()> {
    begin_log(options.log)?;
    let wanted = SocketAddr::from((options.bind, options.port));
    let token = token(options)?;
    let listener = tokio::net::TcpListener::bind(wanted).await.with_context(|| {
        format!("cannot listen on {wanted}; if it is in use, choose another with --port")
    })?;
    let address = format!("http://{}", listener.local_addr()?);
    let (stopping, mut stopped) = tokio::sync::watch::channel(false);
    let engine = engine(options).await?;
    // Only now: the folder is this server's own, and whoever reads the address may rely on it.
    println!("{address}");
    std::io::stdout().flush()?;
    if options.open {
        open(&address);
    }
    let limits = Limits {
        changes_per_second: options.rate,
        kept_mesh_bytes: options.meshes.saturating_mul(GB),
        free_bytes: options.free.saturating_mul(GB),
        ..Limits::default()
    };
    let mut state = AppState::new(&options.web, &options.models)
        .with_limits(limits)
        .with_default_model(&options.default_model)
        .with_origins(options.allow_origin.iter().cloned());
    if let Some(token) = &token {
        state = state.with_token(token);
    }
    if let Some(engine) = &engine {
        state = state.with_engine(engine.clone(), stopped.clone());
    }
    let app = server::app(state).into_make_service_with_connect_info::<SocketAddr>();
    let working = engine.clone().map(|engine| {
        let address = address.clone();
        tokio::spawn(async move { engine.work(&address).await })
    });
    let serving = axum::serve(listener, app).with_graceful_shutdown(async move {
        stop_signal().await;
        stopping.send_replace(true);
    });
    let mut told = stopped.clone();
    let served = async move {
        let too_long = async {
            // An error here means that nobody can tell the server to stop any more: it has stopped.
            stopped.wait_for(|stopped| *stopped).await.ok();
            tokio::time::sleep(GRACE).await;
        };
        tokio::select! {
            result = serving => result.context("the server failed"),
            () = too_long => Ok(()),
        }
    };
    // To its end, also if nobody is left to serve: a change of a job that is begun and left holds up the next one.
    let rested = async {
        told.wait_for(|stopped| *stopped).await.ok();
        if let Some(working) = &working {
            working.abort();
        }
        if let Some(engine) = &engine {
            engine.rest().await;
        }
    };
    let (served, ()) = tokio::join!(served, rested);
    served
}

/// The token that changes need, if they need one.
fn token(options: &Options) -> anyhow::Result<Option<String>> {
    let Some(path) = &options.token_file else {
        if !options.bind.is_loopback() {
            bail!(
                "whoever reaches {} could start jobs: give a token with --token-file FILE, or listen on 127.0.0.1",
                options.bind
            );
        }
        return Ok(None);
    };
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the token in {}", path.display()))?;
    let token = text.trim().to_owned();
    if token.len() < SHORTEST_TOKEN {
        bail!("the token in {} has fewer than {SHORTEST_TOKEN} characters", path.display());
    }
    Ok(Some(token))
}

/// What does the jobs, if there is a folder for them.
async fn engine(options: &Options) -> anyhow::Result<Option<Arc<Engine>>> {
    let Some(data) = &options.data else { return Ok(None) };
    let config = EngineConfig {
        data: data.clone(),
        models: options.models.clone(),
        program: std::env::current_exe().context("where this program is")?,
        places: options.places,
        free_bytes: options.free.saturating_mul(GB),
    };
    Ok(Some(Engine::open(config).await?))
}

/// Resolves at Ctrl-C, and at SIGTERM where there is one.
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

/// Opens the page, where there is a desktop to open it on; the address was printed in any case.
fn open(address: &str) {
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
    // A desktop without a browser is no reason not to serve.
    silent.stderr(Stdio::null()).spawn().ok();
}
