// `smartsurf run --worlds N`: runs N independent copies of one experiment in one process, each with its own
// seed, segment, files and thread. Each world equals a single run with its seed.
#pragma once

#include <atomic>

#include "smartsurf/run/options/RunOptions.h"

namespace smartsurf::run {

inline constexpr int kMaxWorlds = 1024;

// The options of world `index`, from 0: the seed is first_seed + index; "-<index>" is appended to the
// segment's name and to the stem of the recordings.
RunOptions world_options(const RunOptions& shared, int index, std::uint64_t first_seed);

// Runs all worlds to their ends; a failed world does not stop the others. Returns the first exit status, in
// order of worlds, that is not kDone. --stats writes one file for all worlds. If worlds ended with an input
// error, throws that of the first as scene::InputError after all have ended.
int run_worlds(const RunOptions& shared, int count);

}  // namespace smartsurf::run
