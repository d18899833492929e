#include "smartsurf/surface/ActuatorArray.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/CellChannels.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/SkinShape.h"
#include "smartsurf/surface/actuators/ActuatorRegistry.h"
#include "smartsurf/surface/actuators/PinKernels.h"

namespace smartsurf::surface {
namespace {

constexpr double kCommandCost_ns = 0.4;  // per cell

template <class Visit>
void for_each_cell(std::span<const CellRun> runs, Visit visit) {
  for (const CellRun& run : runs)
    for (int i = run.begin; i < run.end; ++i) visit(i);
}

// Returns the cells for which has(row, column) is true, as runs.
template <class Has>
std::vector<CellRun> find_runs(const scene::SurfaceSpec& surface, Has has) {
  std::vector<CellRun> runs;
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

bool is_fixed_border(const scene::SurfaceSpec& surface, int row, int column) {
  return surface.border_height && surface.is_border(row, column);
}

int actuator_of(const scene::SurfaceSpec& surface, int row, int column) {
  if (is_fixed_border(surface, row, column)) return scene::kEmptyCell;
  if (surface.actuator_of_cell.empty()) return 0;
  return surface.actuator_of_cell[surface.index(row, column)];
}

}  // namespace

ActuatorArray::ActuatorArray(const scene::SurfaceSpec& surface, const FaultMap& map, std::uint64_t seed,
                             common::ThreadPool* pool)
    : pool_(pool), channels_(surface.actuator_channels()) {
  init_geometry(surface);
  const std::vector<scene::ActuatorSpec> specs = surface.effective_actuators();
  for (std::size_t model_index = 0; model_index < specs.size(); ++model_index) {
    const auto has_model = [&](int r, int c) {
      return actuator_of(surface, r, c) == static_cast<int>(model_index);
    };
    models_.push_back({specs[model_index], find_runs(surface, has_model), nullptr});
  }
  init_heights(surface);
  for (Model& model : models_) {
    model.actuator = make_actuator({surface, model.spec, model.runs, field_, pool});
    all_pins_ &= model.spec.model == "pin";
    exerts_forces_ |= model.actuator->exerts_forces();
    has_joints_ |= model.actuator->has_joints();
  }
  add_routes(surface, map, seed);
  init_tips();
  init_targets();
  if (!surface.skin) return;
  skin_shape_ = std::make_unique<SkinShape>(surface, field_);
  field_.update_column_height();
  static_max_height_ = std::max(static_max_height_, *std::ranges::max_element(field_.skin.height));
}

ActuatorArray::~ActuatorArray() = default;

void ActuatorArray::init_geometry(const scene::SurfaceSpec& surface) {
  field_.rows = surface.rows;
  field_.columns = surface.columns;
  field_.pitch = static_cast<float>(surface.pitch);
  field_.half_top_x = static_cast<float>(surface.pin.top_x / 2.0);
  field_.half_top_y = static_cast<float>(surface.pin.top_y / 2.0);
  for (const scene::CellPose& cell_pose : surface.cell_poses) {
    field_.x.push_back(static_cast<float>(cell_pose.x));
    field_.y.push_back(static_cast<float>(cell_pose.y));
    field_.angle.push_back(static_cast<float>(cell_pose.angle));
  }
}

// Sets the heights of the cells at rest, before any model moves them.
void ActuatorArray::init_heights(const scene::SurfaceSpec& surface) {
  const int cells = surface.cell_count();
  field_.height.assign(cells, kNoCellHeight);
  field_.speed.assign(cells, 0.0F);
  field_.impulse.assign(cells, 0.0F);
  for (const Model& model : models_) {
    const auto rest_height = static_cast<float>(model.spec.has("height") ? model.spec.number("height") : 0.0);
    for_each_cell(model.runs,
                  [&](std::size_t i) { field_.height[i] = surface.base_height(i) + rest_height; });
  }
  for_each_cell(
      find_runs(surface,
                [&](int r, int c) { return is_fixed_border(surface, r, c) && !surface.is_empty(r, c); }),
      [&](std::size_t i) { field_.height[i] = static_cast<float>(*surface.border_height); });
}

void ActuatorArray::add_routes(const scene::SurfaceSpec& surface, const FaultMap& map, std::uint64_t seed) {
  std::vector<int> actuated_cells;
  for (int i = 0; i < surface.cell_count(); ++i)
    if (actuator_of(surface, i / surface.columns, i % surface.columns) != scene::kEmptyCell)
      actuated_cells.push_back(i);
  const scene::CellChannels cell_channels(surface);
  faults_ = std::make_unique<ActuatorFaults>(surface, channels_, cell_channels, actuated_cells, map, seed);
  for (std::size_t channel = 0; channel < channels_.size(); ++channel) {
    std::vector<float> safe = cell_channels.safe_values(channel);
    commands_.push_back({.values = safe, .safe = safe, .runs = {}, .dirty = true});
  }
  for (Model& model : models_) {
    const scene::ActuatorKind& kind = *scene::find_actuator_kind(model.spec.model);
    const auto model_channels = kind.channels(model.spec);
    for (std::size_t k = 0; k < model_channels.size(); ++k) {
      const auto it = std::ranges::find(channels_, model_channels[k].name, &scene::ActuatorChannel::name);
      const auto channel = static_cast<int>(it - channels_.begin());
      ChannelCommands& commands = commands_[channel];
      commands.runs.insert(commands.runs.end(), model.runs.begin(), model.runs.end());
      CommandRoute route{.model = model.actuator.get(),
                         .model_channel = static_cast<int>(k),
                         .channel = channel,
                         .minimum = static_cast<float>(model_channels[k].minimum),
                         .maximum = static_cast<float>(model_channels[k].maximum),
                         .latency = static_cast<int>(model.spec.number("latency")),
                         .runs = model.runs};
      if (kind.disc_radius && k < 2) {
        route.disc_radius = static_cast<float>(kind.disc_radius(model.spec));
        commands.in_disc = true;
      }
      // The current frame and one per period of latency.
      const int depth = route.latency + faults_->latency(channel) + 1;
      route.passthrough = depth == 1 && !faults_->has_faults(channel) &&
                          model_channels[k].minimum == it->minimum &&
                          model_channels[k].maximum == it->maximum;
      if (!route.passthrough) route.delay_line.assign(depth, std::vector<float>(field_.height.size(), 0.0F));
      if (depth > 1) route.delayed = route.delay_line.front();
      routes_.push_back(std::move(route));
    }
  }
}

void ActuatorArray::init_tips() {
  bool tilts = false, moves_sideways = false, yields = false;
  for (const Model& model : models_) {
    const std::optional<TipKind> kind = model.actuator->tip();
    if (!kind || model.runs.empty()) continue;
    field_.tip_of_cell.resize(field_.height.size(), -1);
    for_each_cell(model.runs, [&](std::size_t i) {
      field_.tip_of_cell[i] = static_cast<std::int8_t>(field_.tips.size());
    });
    field_.tips.push_back(kind->tip);
    field_.tip_reach = std::max(field_.tip_reach, kind->reach);
    tilts |= kind->tip.shape == CellTip::Shape::kPlate;
    moves_sideways |= kind->tip.moves_sideways();
    yields |= kind->tip.yields();
    field_.has_elastic_tops |= kind->tip.shape == CellTip::Shape::kElasticTop;
  }
  const std::size_t cells = field_.height.size();
  if (moves_sideways) {
    field_.offset = field_.offset_rate = std::vector<Eigen::Vector2f>(cells, Eigen::Vector2f::Zero());
    field_.tip_impulse.assign(cells, Eigen::Vector3f::Zero());
  }
  if (yields) field_.yielding.resize(cells);
  if (tilts) field_.tilt = field_.tilt_rate = std::vector<TopTilt>(field_.height.size());
}

void ActuatorArray::init_targets() {
  if (std::ranges::any_of(models_, [](const Model& m) { return m.actuator->has_surface_velocity(); }))
    field_.surface_velocity_x = field_.surface_velocity_y = field_.surface_spin =
        std::vector<float>(field_.height.size(), 0.0F);
  if (std::ranges::any_of(models_, [](const Model& m) { return m.actuator->has_force_limit(); }))
    field_.force_limit = field_.no_load_speed =
        std::vector<float>(field_.height.size(), std::numeric_limits<float>::infinity());
  for (CommandRoute& route : routes_) {
    for (route.head = 0; route.head + 1 < route.delay_line.size(); ++route.head) apply_faults(route);
    deliver_commands(route);
  }
  for (ChannelCommands& commands : commands_) commands.dirty = false;
  for (ChannelCommands& commands : commands_) std::ranges::sort(commands.runs, {}, &CellRun::begin);
  for (Model& model : models_) model.actuator->snap_to_targets(field_);
  field_.update_column_height();
  static_max_height_ = *std::ranges::max_element(field_.height);
  field_.max_height = static_max_height_;
}

std::uint64_t ActuatorArray::set_targets(int channel, std::span<const float> targets,
                                         int first_cell) noexcept {
  const int end_cell = first_cell + static_cast<int>(targets.size());
  assert(first_cell >= 0 && end_cell <= std::ssize(field_.height));
  const scene::ActuatorChannel& info = channels_[channel];
  ChannelCommands& commands = commands_[channel];
  constexpr float kMax = std::numeric_limits<float>::max();
  const auto minimum = static_cast<float>(info.minimum), maximum = static_cast<float>(info.maximum);
  const float low = commands.in_disc ? -kMax : minimum, high = commands.in_disc ? kMax : maximum;
  const auto first_run = std::ranges::upper_bound(commands.runs, first_cell, {}, &CellRun::end);
  const auto end_run = std::ranges::lower_bound(commands.runs, end_cell, {}, &CellRun::begin);
  const auto runs =
      std::span(commands.runs)
          .subspan(first_run - commands.runs.begin(), std::max<std::ptrdiff_t>(0, end_run - first_run));
  std::atomic<std::uint64_t> replaced = 0, nan = 0;
  std::atomic<bool> changed = false;
  const auto clamp_runs = [&](int begin, int end) {
    const CommandUpdate update =
        clamp_commands(runs.subspan(begin, end - begin), {first_cell, end_cell}, targets.data(), low, high,
                       commands.safe.data(), commands.values.data());
    replaced.fetch_add(update.clamped + update.nan, std::memory_order_relaxed);
    nan.fetch_add(update.nan, std::memory_order_relaxed);
    if (update.changed) changed.store(true, std::memory_order_relaxed);
  };
  const int count = static_cast<int>(runs.size());
  if (pool_ != nullptr)
    pool_->parallel_for_rows(count, kCommandCost_ns * static_cast<double>(targets.size()), clamp_runs);
  else
    clamp_runs(0, count);
  commands.dirty |= changed;
  nan_targets_ += nan;
  if (commands.in_disc)
    for_each_cell(runs, [&](int i) {
      const float value = commands.values[i];
      const bool is_counted = i < first_cell || i >= end_cell || std::abs(value) == kMax;
      if (!is_counted && (value < minimum || value > maximum)) ++replaced;
    });
  return replaced;
}

// Clamps the commands of channels in discs: of a model with a disc to its nearest point, of others to the
// channel's range. Leaves commands that it clamped before as they are.
void ActuatorArray::clamp_to_discs() noexcept {
  for (std::size_t r = 0; r < routes_.size(); ++r) {
    const CommandRoute& route = routes_[r];
    ChannelCommands& commands = commands_[route.channel];
    if (!commands.in_disc) continue;
    if (route.disc_radius == 0.0F) {
      if (!commands.dirty) continue;
      const scene::ActuatorChannel& info = channels_[route.channel];
      const auto low = static_cast<float>(info.minimum), high = static_cast<float>(info.maximum);
      for_each_cell(route.runs,
                    [&](int i) { commands.values[i] = std::clamp(commands.values[i], low, high); });
      continue;
    }
    if (route.model_channel != 0) continue;
    ChannelCommands& others = commands_[routes_[r + 1].channel];
    if (!commands.dirty && !others.dirty) continue;
    constexpr double kRounding = 1e-6;
    const auto radius = static_cast<double>(route.disc_radius);
    for_each_cell(route.runs, [&](int i) {
      const auto x = static_cast<double>(commands.values[i]), y = static_cast<double>(others.values[i]);
      const double distance = std::sqrt(x * x + y * y);
      if (distance <= (1.0 + kRounding) * radius) return;
      commands.values[i] = static_cast<float>(x * (radius / distance));
      others.values[i] = static_cast<float>(y * (radius / distance));
      commands.dirty = others.dirty = true;
    });
  }
}

std::uint64_t ActuatorArray::set_target(int channel, int row, int column, float target) noexcept {
  return set_targets(channel, {&target, 1}, field_.index(row, column));
}

// Writes the effective commands of the route's cells to the newest frame.
void ActuatorArray::apply_faults(CommandRoute& route) noexcept {
  const std::vector<float>& commands = commands_[route.channel].values;
  std::vector<float>& frame = route.delay_line[route.head];
  const bool faulty = faults_->has_faults(route.channel);
  for_each_cell(route.runs, [&](std::size_t i) {
    const float command = std::clamp(commands[i], route.minimum, route.maximum);
    frame[i] = faulty ? std::clamp(faults_->effective_command(route.channel, i, command), route.minimum,
                                   route.maximum)
                      : command;
  });
}

void ActuatorArray::deliver_commands(CommandRoute& route) noexcept {
  if (route.passthrough) {
    route.model->set_targets(route.model_channel, commands_[route.channel].values);
    return;
  }
  apply_faults(route);
  if (route.delay_line.size() == 1) {
    route.model->set_targets(route.model_channel, route.delay_line.front());
    return;
  }
  const std::size_t depth = route.delay_line.size();
  for_each_cell(route.runs, [&](std::size_t i) {
    const int latency = route.latency + faults_->latency(route.channel, i);
    route.delayed[i] = route.delay_line[(route.head + depth - latency) % depth][i];
  });
  route.model->set_targets(route.model_channel, route.delayed);
}

void ActuatorArray::begin_tick() noexcept {
  clamp_to_discs();
  for (CommandRoute& route : routes_) {
    if (route.delay_line.size() <= 1) continue;
    route.head = (route.head + 1) % route.delay_line.size();
    deliver_commands(route);
  }
}

void ActuatorArray::plan(double dt_s) noexcept {
  clamp_to_discs();
  for (CommandRoute& route : routes_)
    if (route.delay_line.size() <= 1 && commands_[route.channel].dirty) deliver_commands(route);
  for (ChannelCommands& commands : commands_) commands.dirty = false;
  field_.max_height = static_max_height_;
  field_.max_speed = 0.0F;
  for (Model& model : models_) model.actuator->plan(dt_s, field_);
  if (skin_shape_) skin_shape_->plan(dt_s, field_);
}

void ActuatorArray::commit(double dt_s) noexcept {
  for (Model& model : models_) model.actuator->commit(dt_s, field_);
  if (skin_shape_) skin_shape_->commit(field_);
}

void ActuatorArray::archive(common::StateArchive& a) {
  field_.archive_motion(a);
  for (ChannelCommands& commands : commands_) a(commands.values, commands.dirty);
  for (CommandRoute& route : routes_) a(route.delay_line, route.head, route.delayed);
  for (Model& model : models_) model.actuator->archive(a);
}

bool ActuatorArray::needs_impulses() const noexcept {
  return std::ranges::any_of(models_, [](const Model& m) { return m.actuator->needs_impulses(); });
}

void ActuatorArray::add_forces(double dt_s, const BodyView& bodies,
                               std::span<const scene::ObjectSpec> catalogue,
                               std::span<Wrench> wrenches) noexcept {
  for (Model& model : models_)
    if (model.actuator->exerts_forces())
      model.actuator->add_forces(dt_s, field_, bodies, catalogue, wrenches);
}

std::optional<RefusedOutput> ActuatorArray::refused_output() const noexcept {
  for (const Model& model : models_)
    if (const auto refused = model.actuator->refused_output()) return refused;
  return std::nullopt;
}

void ActuatorArray::write_cell_motion(std::vector<scene::ActuatorState>& motion) const {
  motion.assign(all_pins_ ? 0 : field_.height.size(), {});
  if (all_pins_) return;
  for (const Model& model : models_) model.actuator->write_cell_motion(motion);
}

void ActuatorArray::write_joint_positions(std::vector<float>& positions) const {
  positions.assign(has_joints_ ? scene::kMaxJoints * field_.height.size() : 0, 0.0F);
  if (!has_joints_) return;
  for (const Model& model : models_) model.actuator->write_joint_positions(positions);
}

}  // namespace smartsurf::surface
