// Runs one experiment on two engines and finds where the results part.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::run {

// One object in one run, with one value per tick from tick 0 on; shorter if the object was created late or
// the run ended. Where it did not exist, the position is NaN and the load 0.
struct ObjectTrace {
  std::vector<Eigen::Vector3f> position;  // u
  // Magnitude of the sum of its contacts' normal forces in the tick's last physics step, mass·u/s².
  std::vector<float> load;
};

struct EngineTrace {
  std::string engine, version;
  std::vector<double> time_s;        // one per tick, from tick 0
  std::vector<ObjectTrace> objects;  // index = id
  std::vector<scene::ObjectSpec> catalogue;
  scene::Metrics metrics;
};

// Runs the experiment of `options` on its engine. Throws scene::InputError as Run does, and if the run fails.
EngineTrace trace_run(const RunOptions& options, const std::atomic<bool>& stop);

// The fate of one object in both runs.
struct Verdict {
  scene::ObjectId id = 0;
  std::string name;               // "ball" or "sphere"
  double size = 0.0;              // largest extent, u
  std::optional<double> parts_s;  // when it was first farther apart than the tolerance, or in one run only
  double greatest_distance = 0.0, final_distance = 0.0;  // u, over the ticks in which both runs have it
  // Mean load in each run until they part, mass·u/s².
  double load[2] = {0.0, 0.0};
};

struct Comparison {
  double tolerance = 0.0;         // u
  double end_s = 0.0;             // of the shorter run
  std::vector<Verdict> verdicts;  // ascending by id
};

Comparison compare(const EngineTrace& first, const EngineTrace& second, double tolerance);

// The distance of an object's positions in both runs, one per common tick; NaN where a run lacks it.
std::vector<double> distances(const EngineTrace& first, const EngineTrace& second, scene::ObjectId);

}  // namespace smartsurf::run
