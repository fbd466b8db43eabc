// Begins the page: the engine, and while it comes, all else.

import { beginEarly } from "./first";

beginEarly();
void import("./main");
