#include "smartsurf/surface/ActuatorArray.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "smartsurf/surface/PinKernels.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

constexpr double kCommand_ns = 0.4;  // of one cell

template <class Visit>
void for_cells(std::span<const Run> runs, Visit visit) {
  for (const Run& run : runs)
    for (auto i = static_cast<std::size_t>(run.begin); i < static_cast<std::size_t>(run.end); ++i) visit(i);
}

// The cells for which `has(row, column)` holds, as runs.
template <class Has>
std::vector<Run> runs_of(const scene::SurfaceSpec& surface, Has has) {
  std::vector<Run> runs;
  for (int r = 0; r < surface.rows; ++r)
    for (int c = 0; c < surface.columns; ++c) {
      if (!has(r, c)) continue;
      const int i = surface.index(r, c);
      if (c > 0 && !runs.empty() && runs.back().end == i)
        ++runs.back().end;
      else
        runs.push_back({i, i + 1});
    }
  return runs;
}

bool held(const scene::SurfaceSpec& surface, int row, int column) {
  return surface.border_height && surface.is_border(row, column);
}

int actuator_of(const scene::SurfaceSpec& surface, int row, int column) {
  if (held(surface, row, column)) return scene::kEmptyCell;
  if (surface.actuator_of_cell.empty()) return 0;
  return surface.actuator_of_cell[static_cast<std::size_t>(surface.index(row, column))];
}

}  // namespace

ActuatorArray::ActuatorArray(const scene::SurfaceSpec& surface, const FaultMap& map, std::uint64_t seed,
                             WorkerPool* pool)
    : pool_(pool), channels_(surface.actuator_channels()) {
  shape(surface);
  const std::vector<scene::ActuatorSpec> mechanisms = surface.mechanisms();
  for (std::size_t m = 0; m < mechanisms.size(); ++m) {
    const auto mine = [&](int r, int c) { return actuator_of(surface, r, c) == static_cast<int>(m); };
    models_.push_back({mechanisms[m], runs_of(surface, mine), nullptr});
  }
  place_cells(surface);
  for (Model& model : models_)
    model.actuator = make_actuator({surface, model.spec, model.runs, field_, pool});
  add_routes(surface, map, seed);
  start();
}

ActuatorArray::~ActuatorArray() = default;

void ActuatorArray::shape(const scene::SurfaceSpec& surface) {
  field_.rows = surface.rows;
  field_.columns = surface.columns;
  field_.pitch = static_cast<float>(surface.pitch);
  field_.half_top_x = static_cast<float>(surface.pin.top_x / 2.0);
  field_.half_top_y = static_cast<float>(surface.pin.top_y / 2.0);
  for (const scene::CellPlace& place : surface.places) {
    field_.x.push_back(static_cast<float>(place.x));
    field_.y.push_back(static_cast<float>(place.y));
    field_.angle.push_back(static_cast<float>(place.angle));
  }
}

// Heights of the cells at rest, before any model moves them.
void ActuatorArray::place_cells(const scene::SurfaceSpec& surface) {
  const auto cells = static_cast<std::size_t>(surface.cells());
  field_.height.assign(cells, kNoCell);
  field_.speed.assign(cells, 0.0F);
  field_.impulse.assign(cells, 0.0F);
  const auto base = [&](std::size_t i) { return surface.base.empty() ? 0.0F : surface.base[i]; };
  for (const Model& model : models_) {
    const auto rest = static_cast<float>(model.spec.has("height") ? model.spec.number("height") : 0.0);
    for_cells(model.runs, [&](std::size_t i) { field_.height[i] = base(i) + rest; });
  }
  for_cells(runs_of(surface, [&](int r, int c) { return held(surface, r, c) && !surface.is_empty(r, c); }),
            [&](std::size_t i) { field_.height[i] = static_cast<float>(*surface.border_height); });
}

void ActuatorArray::add_routes(const scene::SurfaceSpec& surface, const FaultMap& map, std::uint64_t seed) {
  std::vector<int> acting;
  for (int i = 0; i < surface.cells(); ++i)
    if (actuator_of(surface, i / surface.columns, i % surface.columns) != scene::kEmptyCell)
      acting.push_back(i);
  faults_ = std::make_unique<ActuatorFaults>(surface, channels_, acting, map, seed);
  for (const scene::ActuatorChannel& channel : channels_)
    commands_.push_back(
        {std::vector<float>(field_.height.size(), static_cast<float>(channel.safe)), {}, true});
  for (Model& model : models_) {
    const auto own = scene::find_actuator_kind(model.spec.model)->channels(model.spec);
    for (std::size_t k = 0; k < own.size(); ++k) {
      const auto it = std::ranges::find(channels_, own[k].name, &scene::ActuatorChannel::name);
      const auto channel = static_cast<int>(it - channels_.begin());
      Commands& commands = commands_[static_cast<std::size_t>(channel)];
      commands.runs.insert(commands.runs.end(), model.runs.begin(), model.runs.end());
      for_cells(model.runs, [&](std::size_t i) { commands.values[i] = static_cast<float>(own[k].safe); });
      Route route{.model = model.actuator.get(),
                  .model_channel = static_cast<int>(k),
                  .channel = channel,
                  .low = static_cast<float>(own[k].minimum),
                  .high = static_cast<float>(own[k].maximum),
                  .latency = static_cast<int>(model.spec.number("latency")),
                  .runs = model.runs};
      const int depth = route.latency + faults_->latency(channel) + 1;
      route.direct = depth == 1 && !faults_->any(channel) && own[k].minimum == it->minimum &&
                     own[k].maximum == it->maximum;
      if (!route.direct)
        route.frames.assign(static_cast<std::size_t>(depth), std::vector<float>(field_.height.size(), 0.0F));
      if (depth > 1) route.out = route.frames.front();
      routes_.push_back(std::move(route));
    }
  }
}

void ActuatorArray::start() {
  if (std::ranges::any_of(models_, [](const Model& m) { return m.actuator->drags(); }))
    field_.drag_x = field_.drag_y = field_.spin = std::vector<float>(field_.height.size(), 0.0F);
  if (std::ranges::any_of(models_, [](const Model& m) { return m.actuator->yields(); }))
    field_.force_limit.assign(field_.height.size(), std::numeric_limits<float>::infinity());
  for (Route& route : routes_) {
    for (route.newest = 0; route.newest + 1 < route.frames.size(); ++route.newest) feel(route);
    deliver(route);
  }
  for (Commands& commands : commands_) commands.fresh = false;
  for (Model& model : models_) model.actuator->settle(field_);
  resting_height_ = *std::ranges::max_element(field_.height);
  field_.max_height = resting_height_;
}

void ActuatorArray::set_targets(int channel, std::span<const float> targets) noexcept {
  assert(targets.size() == field_.height.size());
  const scene::ActuatorChannel& is = channels_[static_cast<std::size_t>(channel)];
  const auto low = static_cast<float>(is.minimum), high = static_cast<float>(is.maximum);
  Commands& commands = commands_[static_cast<std::size_t>(channel)];
  const auto band = [&](int begin, int end) {
    for (int r = begin; r < end; ++r) {
      const Run& run = commands.runs[static_cast<std::size_t>(r)];
      take_commands(static_cast<std::size_t>(run.end - run.begin),
                    &targets[static_cast<std::size_t>(run.begin)], low, high,
                    &commands.values[static_cast<std::size_t>(run.begin)]);
    }
  };
  const int runs = static_cast<int>(commands.runs.size());
  if (pool_ != nullptr)
    pool_->for_rows(runs, kCommand_ns * static_cast<double>(targets.size()), band);
  else
    band(0, runs);
  commands.fresh = true;
}

void ActuatorArray::set_target(int channel, int row, int column, float target) noexcept {
  const scene::ActuatorChannel& is = channels_[static_cast<std::size_t>(channel)];
  Commands& commands = commands_[static_cast<std::size_t>(channel)];
  const int cell = field_.index(row, column);
  const bool has =
      std::ranges::any_of(commands.runs, [cell](const Run& r) { return r.begin <= cell && cell < r.end; });
  if (std::isnan(target) || !has) return;
  commands.values[static_cast<std::size_t>(cell)] =
      std::clamp(target, static_cast<float>(is.minimum), static_cast<float>(is.maximum));
  commands.fresh = true;
}

// What the route's cells make of the commands, into the newest frame.
void ActuatorArray::feel(Route& route) noexcept {
  const std::vector<float>& commands = commands_[static_cast<std::size_t>(route.channel)].values;
  std::vector<float>& frame = route.frames[route.newest];
  const bool faulty = faults_->any(route.channel);
  for_cells(route.runs, [&](std::size_t i) {
    const float command = std::clamp(commands[i], route.low, route.high);
    frame[i] = faulty ? std::clamp(faults_->felt(route.channel, i, command), route.low, route.high) : command;
  });
}

void ActuatorArray::deliver(Route& route) noexcept {
  if (route.direct) {
    route.model->set_targets(route.model_channel, commands_[static_cast<std::size_t>(route.channel)].values);
    return;
  }
  feel(route);
  if (route.frames.size() == 1) {
    route.model->set_targets(route.model_channel, route.frames.front());
    return;
  }
  const std::size_t depth = route.frames.size();
  for_cells(route.runs, [&](std::size_t i) {
    const auto late = static_cast<std::size_t>(route.latency + faults_->latency(route.channel, i));
    route.out[i] = route.frames[(route.newest + depth - late) % depth][i];
  });
  route.model->set_targets(route.model_channel, route.out);
}

void ActuatorArray::begin_tick() noexcept {
  for (Route& route : routes_) {
    if (route.frames.size() <= 1) continue;
    route.newest = (route.newest + 1) % route.frames.size();
    deliver(route);
  }
}

void ActuatorArray::plan(double dt_s) noexcept {
  for (Route& route : routes_)
    if (route.frames.size() <= 1 && commands_[static_cast<std::size_t>(route.channel)].fresh) deliver(route);
  for (Commands& commands : commands_) commands.fresh = false;
  field_.max_height = resting_height_;
  field_.max_speed = 0.0F;
  for (Model& model : models_) model.actuator->plan(dt_s, field_);
}

void ActuatorArray::commit(double dt_s) noexcept {
  for (Model& model : models_) model.actuator->commit(dt_s, field_);
}

bool ActuatorArray::exerts_forces() const noexcept {
  return std::ranges::any_of(models_, [](const Model& m) { return m.actuator->exerts_forces(); });
}

void ActuatorArray::forces(double dt_s, const Bodies& bodies, std::span<const scene::ObjectSpec> catalogue,
                           std::span<Wrench> wrenches) noexcept {
  for (Model& model : models_)
    if (model.actuator->exerts_forces()) model.actuator->forces(dt_s, field_, bodies, catalogue, wrenches);
}

void ActuatorArray::show(std::vector<scene::CellMotion>& motion) const {
  const bool plain = std::ranges::all_of(models_, [](const Model& m) { return m.spec.model == "pin"; });
  motion.assign(plain ? 0 : field_.height.size(), {});
  if (plain) return;
  for (const Model& model : models_) model.actuator->show(motion);
}

}  // namespace smartsurf::surface
