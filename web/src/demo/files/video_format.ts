// Container format in which this browser records video; undefined if it cannot record.

export const VIDEO_FORMAT = ["webm", "mp4"].find((format) => globalThis.MediaRecorder?.isTypeSupported(`video/${format}`));
