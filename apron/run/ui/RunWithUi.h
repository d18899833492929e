// `apron run` with a user interface.
#pragma once

#include <string>

#include "apron/run/options/Options.h"
#include "apron/run/ui/UiRun.h"

namespace apron::run {

// Why the requested user interface cannot be opened, in one line; empty if it can.
std::string ui_unavailable_reason(const Options& options);

// Runs until the user closes the window, a signal arrives or, off-screen, the program finishes. Reports
// errors in the result.
UiRunResult run_with_ui(const UiRun& run);

}  // namespace apron::run
