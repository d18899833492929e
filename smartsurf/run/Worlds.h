// `smartsurf run --worlds N`: N independent copies of one experiment in one process, each with its own seed,
// segment, files and thread. World k equals a single run with its seed.
#pragma once

#include <atomic>

#include "smartsurf/run/cli/RunOptions.h"

namespace smartsurf::run {

inline constexpr int kMaxWorlds = 1024;

// The options of world `index` of several, 0 for the first: `first_seed` + index; "-index" after the
// segment's name and before the extension of what it records.
RunOptions world_options(const RunOptions& shared, int index, std::uint64_t first_seed);

// Runs all of them to their ends; a world that fails does not stop the others. Returns the first exit status
// in order of worlds that is not kDone. With --stats one file tells of all. Throws scene::InputError, after
// all have ended, for what the first world that met a mistake of the user's says of it.
int run_worlds(const RunOptions& shared, int count, const std::atomic<bool>& stop);

}  // namespace smartsurf::run
