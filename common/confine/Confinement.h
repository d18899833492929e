// Confines this process by means of the kernel: Landlock for files, seccomp for system calls. What cannot be
// opened or called then cannot be reached by foreign code either that an error in a reader or interpreter
// might run.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/confine/Rights.h"

namespace common {

// The means of confinement that this kernel has, as one line; `complete` if it has all.
struct ConfinementSupport {
  int landlock = 0;  // version of its interface; 0: none
  bool seccomp = false;
  bool complete() const { return landlock >= 3 && seccomp; }
};
ConfinementSupport confinement_support() noexcept;
std::string describe(const ConfinementSupport&);

// SMARTSURF_CONFINE: "require" refuses to read what cannot be confined, "off" confines nothing; otherwise the
// process is confined as far as the kernel can.
enum class ConfinementMode { kOff, kAvailable, kRequired };
ConfinementMode confinement_mode();  // throws UserError for another value

// Throws UserError if confinement is required: `what`, a clause such as "with --unsafe", cannot be confined.
void leave_unconfined(const std::string& what);

// Confines the calling thread and all threads and processes that it starts; other threads only as to system
// calls. Cannot be undone; a second call confines further. Throws UserError if confinement is required and
// the kernel lacks a part, and std::runtime_error if the kernel refuses what it has: the work must not be
// done then.
void confine(const Confinement&);
bool is_confined() noexcept;

// Adds the files that every program needs of the system: its processor, random numbers, /dev/null.
void add_system_files(Confinement&);
// Likewise to draw pictures: libraries, fonts, drivers.
void add_picture_files(Confinement&);
// The device files of graphics drivers in the folder, /dev, sorted.
std::vector<std::filesystem::path> graphics_devices(const std::filesystem::path& folder);

}  // namespace common
