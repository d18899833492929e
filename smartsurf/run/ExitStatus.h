#pragma once

namespace smartsurf::run {

// Exit statuses of the program.
enum ExitStatus { kDone = 0, kFailed = 1, kUserError = 2, kPeerLost = 3 };

}  // namespace smartsurf::run
