// Runs and replays, and what the user opens in their windows after them.
#pragma once

#include <string>

#include "smartsurf/run/options/RunOptions.h"

namespace smartsurf::run {

// Runs the experiment, again for as long as the user restarts it, and the experiments and recordings that the
// user opens in its window. Returns the exit status of the last. Throws scene::InputError.
int run_session(RunOptions options);
// Begins with a recording instead. pace: recorded seconds per wall second, > 0.
int replay_session(const std::string& recording, double pace, const RenderOptions& render);

}  // namespace smartsurf::run
