// Ends the program if a script cannot be interrupted.
#pragma once

#include <string>

#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "common/process/Termination.h"

namespace smartsurf::run {

// The value of script::LoadOptions::end_process. Ends the program with kUserError, or with the status of its
// stop signal.
inline void end_for_script(const std::string& message) {
  common::end_process(
      message.empty() ? nullptr : message.c_str(),
      common::stop_signal() == 0 ? common::kUserError : common::status_after_signals(common::kDone));
}

}  // namespace smartsurf::run
