//! The table of job kinds, from which their enumerations are generated.

/// Generates [`Kind`](super::Kind), [`Params`](super::Params) and [`JobTask`](super::JobTask) from a table with
/// one entry per kind: its description, the name of the variant, the name in JSON, the title on the page,
/// and the type of its parameters. The attribute `#[serde(default)]` marks parameters that a request may omit.
macro_rules! job_kinds {
    ($(
        #[doc = $doc:tt]
        $kind:ident = $name:tt, $title:tt => $(#[$($attribute:tt)*])* $module:ident::$params:ident;
    )*) => {
        $(pub(crate) use $module::$params;)*

        /// Kind of a job; selects the worker command and the parameters.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
        pub(crate) enum Kind {
            $(
                #[doc = $doc]
                #[serde(rename = $name)]
                $kind,
            )*
        }

        impl Kind {
            /// All kinds, in the order of the documentation.
            pub(crate) const ALL: &[Self] = &[$(Self::$kind,)*];

            /// Name in JSON and in the database.
            pub(crate) fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }
        }

        /// Kind of a job with its parameters; all defaults are filled in by [`Params::resolve`].
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", content = "params")]
        pub(crate) enum Params {
            $(
                #[doc = $doc]
                #[serde(rename = $name)]
                $kind($params),
            )*
        }

        impl Params {
            /// Kind of the job.
            pub(crate) fn kind(&self) -> Kind {
                match self {
                    $(Self::$kind(_) => Kind::$kind,)*
                }
            }

            /// Parses and validates the parameters of a job kind, and fills in defaults.
            pub(crate) fn resolve(kind: Kind, given: Map<String, Value>) -> Result<Self, Invalid> {
                let given = Value::Object(given);
                Ok(match kind {
                    $(Kind::$kind => Self::$kind(parse::<$params>(given)?.resolve()?),)*
                })
            }

            /// See [`JobKind::resolve_aliases`].
            pub(crate) fn resolve_aliases(&mut self, resolve: impl Fn(&str) -> String) {
                match self {
                    $(Self::$kind(params) => params.resolve_aliases(&resolve),)*
                }
            }

            /// See [`JobKind::seed`].
            pub(crate) fn seed(&self) -> u64 {
                match self {
                    $(Self::$kind(params) => params.seed(),)*
                }
            }

            /// See [`JobKind::has_mesh_size`].
            pub(crate) fn has_mesh_size(&self) -> bool {
                match self {
                    $(Self::$kind(params) => params.has_mesh_size(),)*
                }
            }

            /// See [`JobKind::inputs`].
            pub(crate) fn inputs(&self) -> Inputs {
                match self {
                    $(Self::$kind(params) => params.inputs(),)*
                }
            }

            /// See [`JobKind::argv`].
            pub(crate) fn argv(&self, inputs: &InputPaths) -> Vec<String> {
                match self {
                    $(Self::$kind(params) => params.argv(inputs),)*
                }
            }

            /// See [`JobKind::collect`].
            pub(crate) async fn collect(
                &self,
                outputs: &mut OutputCollector<'_>,
            ) -> Result<(), StoreError> {
                match self {
                    $(Self::$kind(params) => params.collect(outputs).await,)*
                }
            }

            /// See [`JobKind::cost`].
            pub(crate) fn cost(&self) -> Cost {
                match self {
                    $(Self::$kind(params) => params.cost(),)*
                }
            }

            /// See [`JobKind::is_comparable`]; jobs of different kinds are not comparable.
            pub(crate) fn is_comparable(&self, other: &Self) -> bool {
                match (self, other) {
                    $((Self::$kind(params), Self::$kind(other)) => params.is_comparable(other),)*
                    _ => false,
                }
            }
        }

        /// Parameters without the kind, as clients receive them.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct ParamsView<'a>(pub(crate) &'a Params);

        impl Serialize for ParamsView<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self.0 {
                    $(Params::$kind(params) => params.serialize(serializer),)*
                }
            }
        }

        /// OpenAPI schema of job kind and parameters, one variant per kind. The schema of a creation request is
        /// built from it.
        #[derive(ToSchema)]
        #[serde(tag = "kind")]
        #[expect(dead_code, reason = "OpenAPI schema")]
        pub(crate) enum JobTask {
            $(
                #[schema(title = $title)]
                #[serde(rename = $name)]
                $kind {
                    $(#[$($attribute)*])*
                    params: $params,
                },
            )*
        }

        /// Names of the creation requests in the OpenAPI description, in the order of [`Kind::ALL`].
        pub(crate) const REQUEST_NAMES: &[&str] = &[$(concat!(stringify!($kind), "Request"),)*];

        /// OpenAPI schema of the parameters of any job kind. `anyOf` instead of `oneOf`, because parameters of
        /// one kind can also match the schema of another.
        pub(crate) fn any_params() -> Schema {
            let names = [$($params::name(),)*];
            let any = AnyOfBuilder::new().description(Some("Parameters with defaults filled in."));
            names.into_iter().fold(any, |any, name| any.item(Ref::from_schema_name(name))).into()
        }
    };
}

pub(super) use job_kinds;
