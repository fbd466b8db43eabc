// What this browser can record a film as, if it can.

export const FILM = ["webm", "mp4"].find((kind) => globalThis.MediaRecorder?.isTypeSupported(`video/${kind}`));
