// Ends a program together with the process that started it, even if that is killed.
#pragma once

namespace common {

// Watches the process that the environment variable SMARTSURF_PARENT names, and removes the variable from the
// environment. When that process ends, this one receives SIGTERM, and again after a second in case the first
// did not end it. Does nothing without the variable. Further calls do nothing.
//
// Unlike a parent-death signal, this does not depend on which thread of the parent started the program.
void watch_parent() noexcept;

}  // namespace common
