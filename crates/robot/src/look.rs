//! What the robot looks like. Stub until lofts exist.
