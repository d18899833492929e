#include "smartsurf/run/compare/Compare.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/run/Run.h"

namespace smartsurf::run {
namespace {

constexpr const char* kShapeNames[] = {"sphere", "box", "cylinder", "capsule", "cone", "solid"};
static_assert(std::size(kShapeNames) == scene::kShapeKindCount);

const Eigen::Vector3f kAbsent = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());

void add_tick(EngineTrace& trace, const simulation::Simulation& simulation) {
  const scene::Snapshot& snapshot = simulation.snapshot();
  const std::size_t tick = trace.time_s.size();
  trace.time_s.push_back(snapshot.time_s);
  trace.objects.resize(simulation.catalogue().size());
  for (ObjectTrace& object : trace.objects) {
    object.position.resize(tick + 1, kAbsent);
    object.load.resize(tick + 1, 0.0F);
  }
  for (std::size_t i = 0; i < snapshot.object_count(); ++i)
    trace.objects[snapshot.id[i]].position[tick] = Eigen::Vector3f(snapshot.position[i].data());
  std::vector<Eigen::Vector3f> impulse(trace.objects.size(), Eigen::Vector3f(0, 0, 0));
  for (const world::ContactPoint& contact : simulation.contacts()) {
    impulse[contact.object] += contact.impulse * contact.normal;
    if (contact.other) impulse[*contact.other] -= contact.impulse * contact.normal;
  }
  const auto dt_s = static_cast<float>(simulation.scene().world.dt_s);
  for (std::size_t id = 0; id < impulse.size(); ++id)
    trace.objects[id].load[tick] = impulse[id].norm() / dt_s;
}

Verdict judge(const EngineTrace& first, const EngineTrace& second, scene::ObjectId id, double tolerance) {
  const scene::ObjectSpec& spec = first.catalogue[id];
  Verdict verdict;
  verdict.id = id;
  verdict.name = spec.label.empty() ? kShapeNames[static_cast<int>(spec.shape)] : spec.label;
  verdict.size = 2.0 * spec.half_extents().maxCoeff();
  const std::vector<double> apart = distances(first, second, id);
  const EngineTrace* runs[] = {&first, &second};
  std::size_t ticks = 0;
  for (std::size_t t = 0; t < apart.size(); ++t) {
    const bool in_first = first.objects[id].position[t].allFinite();
    const bool in_second = second.objects[id].position[t].allFinite();
    if (std::isfinite(apart[t])) {
      verdict.greatest_distance = std::max(verdict.greatest_distance, apart[t]);
      verdict.final_distance = apart[t];
    }
    if (!verdict.parts_s && (apart[t] > tolerance || in_first != in_second))
      verdict.parts_s = first.time_s[t];
    if (verdict.parts_s || !in_first) continue;
    ++ticks;
    for (int k = 0; k < 2; ++k) verdict.load[k] += static_cast<double>(runs[k]->objects[id].load[t]);
  }
  for (double& load : verdict.load) load /= static_cast<double>(std::max<std::size_t>(ticks, 1));
  return verdict;
}

}  // namespace

EngineTrace trace_run(const RunOptions& options, const std::atomic<bool>& stop) {
  EngineTrace trace;
  Run run(options, stop, Run::load(options));
  run.observe([&trace](const simulation::Simulation& simulation) {
    if (trace.time_s.empty()) {
      trace.engine = simulation.engine().name();
      trace.version = simulation.engine().version();
    }
    add_tick(trace, simulation);
    trace.catalogue = simulation.catalogue();
  });
  const int status = run.execute();
  if (status != common::kDone)
    throw scene::InputError("engine '" + *options.engine + "': the run failed (exit status " +
                            std::to_string(status) + ")");
  trace.metrics = run.metrics();
  return trace;
}

std::vector<double> distances(const EngineTrace& first, const EngineTrace& second, scene::ObjectId id) {
  const auto &a = first.objects[id].position, &b = second.objects[id].position;
  std::vector<double> all(std::min(a.size(), b.size()));
  for (std::size_t t = 0; t < all.size(); ++t) all[t] = (a[t] - b[t]).cast<double>().norm();
  return all;
}

Comparison compare(const EngineTrace& first, const EngineTrace& second, double tolerance) {
  Comparison comparison;
  comparison.tolerance = tolerance;
  comparison.end_s = std::min(first.time_s.back(), second.time_s.back());
  const std::size_t objects = std::min(first.objects.size(), second.objects.size());
  for (scene::ObjectId id = 0; id < objects; ++id)
    comparison.verdicts.push_back(judge(first, second, id, tolerance));
  return comparison;
}

}  // namespace smartsurf::run
