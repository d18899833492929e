#include "smartsurf/surface/Imperfections.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "smartsurf/surface/CounterRandom.h"
#include "smartsurf/surface/CsvTable.h"
#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

// Of one number of one channel, about.
constexpr double kCost_ns = 5.0;

// What a stream of random numbers is for.
enum Purpose : std::uint64_t { kNoise, kDrift, kDropout, kFaults, kPurposes };

// By name, so that a sensor's numbers stay the same when others are added (FNV-1a).
std::uint64_t stream_of(const std::string& channel) {
  std::uint64_t h = 0xcbf29ce484222325U;
  for (const char c : channel) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return h * kPurposes;
}

double value_of(const scene::ParameterValues& own, const scene::ParameterValues& common, const char* name) {
  if (const auto it = own.find(name); it != own.end()) return it->second.front();
  if (const auto it = common.find(name); it != common.end()) return it->second.front();
  return 0.0;
}

float within(const scene::SensorChannel& c, double value) {
  return static_cast<float>(std::clamp(value, c.minimum, c.maximum));
}

}  // namespace

Imperfections::Imperfections(const scene::SensorSpec& spec, const scene::SceneSpec& scene,
                             const FaultMap& map)
    : rows_(scene.surface.rows),
      columns_(scene.surface.columns),
      cells_(static_cast<std::size_t>(scene.surface.cells())),
      period_s_(scene.world.control_period_s),
      seed_(scene.world.seed) {
  const scene::ParameterValues& common = scene.surface.faults.sensor;
  const scene::SensorKind& kind = *scene::find_sensor_kind(spec.model);
  mask_ = kind.mask;
  for (scene::SensorChannel& c : kind.channels(spec)) {
    Channel channel;
    channel.stream = stream_of(c.name);
    channel.description = std::move(c);
    channels_.push_back(std::move(channel));
  }
  noise_ = value_of(spec.values, common, "noise");
  quantize_ = value_of(spec.values, common, "quantize");
  drift_ = value_of(spec.values, common, "drift");
  dropout_ = value_of(spec.values, common, "dropout");
  latency_ = static_cast<int>(value_of(spec.values, common, "latency"));
  draw_faults(spec.values, common);
  read_map(map);
  if (spec.calibration) read_calibration(*spec.calibration);
  const bool measures = std::ranges::any_of(channels_, [](const Channel& c) { return !c.description.exact; });
  if (measures && (noise_ > 0.0 || quantize_ > 0.0 || drift_ > 0.0)) any_ = true;
  if (dropout_ > 0.0 || latency_ > 0) any_ = true;
  if (any_) reserve();
}

// Memory for the ticks to come.
void Imperfections::reserve() {
  for (Channel& c : channels_) {
    const std::size_t numbers = cells_ * static_cast<std::size_t>(c.description.components);
    c.readings.resize(numbers);
    if (drift_ > 0.0 && !c.description.exact) c.walk.assign(numbers, 0.0F);
    if (latency_ > 0) c.past.assign(static_cast<std::size_t>(latency_) + 1, std::vector<float>(numbers));
  }
}

// One draw a cell: a greater share hits the same cells and others.
void Imperfections::draw_faults(const scene::ParameterValues& own, const scene::ParameterValues& common) {
  const double dead = value_of(own, common, "dead"), low = value_of(own, common, "stuck_low"),
               high = value_of(own, common, "stuck_high");
  if (dead + low + high <= 0.0) return;
  const CounterRandom random(seed_, channels_.front().stream + kFaults, 0);
  for (std::size_t cell = 0; cell < cells_; ++cell) {
    const double drawn = random.uniform(cell);
    for (Channel& c : channels_) {
      if (drawn < dead)
        break_cell(cell, c, State::kDead, 0.0);
      else if (drawn < dead + low)
        break_cell(cell, c, State::kStuck, measure(c).minimum);
      else if (drawn < dead + low + high)
        break_cell(cell, c, State::kStuck, measure(c).maximum);
    }
  }
}

// What a channel measures; a mask speaks of the first channel.
const scene::SensorChannel& Imperfections::measure(const Channel& c) const {
  return is_mask(c) ? channels_.front().description : c.description;
}

// `value` is of what the channel measures: its mask says whether that is something.
void Imperfections::break_cell(std::size_t cell, Channel& c, State state, double value) {
  any_ = true;
  if (c.state.empty()) {
    c.state.assign(cells_, State::kWorks);
    c.stuck.assign(cells_, 0.0F);
  }
  c.state[cell] = state;
  const float reading = within(measure(c), value);
  c.stuck[cell] = is_mask(c) ? static_cast<float>(reading != within(measure(c), measure(c).none)) : reading;
}

void Imperfections::read_map(const FaultMap& map) {
  for (const FaultEntry& entry : map.entries()) {
    const bool ours =
        std::ranges::any_of(channels_, [&](const Channel& c) { return c.description.name == entry.channel; });
    if (!ours && !entry.channel.empty()) continue;
    // A sensor is one thing: what breaks a channel breaks the mask with it.
    for (Channel& c : channels_)
      if (!ours || c.description.name == entry.channel || is_mask(c)) apply_fault(map, entry, c);
  }
}

// An entry without a channel speaks of the actuators as well: what is no fault of a sensor is one of theirs.
void Imperfections::apply_fault(const FaultMap& map, const FaultEntry& entry, Channel& c) {
  const auto cell = static_cast<std::size_t>(entry.row * columns_ + entry.column);
  const std::string& fault = entry.fault;
  if (fault == "dead") return break_cell(cell, c, State::kDead, 0.0);
  if (fault == "stuck_low") return break_cell(cell, c, State::kStuck, measure(c).minimum);
  if (fault == "stuck_high") return break_cell(cell, c, State::kStuck, measure(c).maximum);
  if (fault != "stuck" && fault != "gain" && fault != "offset") {
    if (entry.channel.empty()) return;
    map.refuse(entry, "fault " + in_quotes(fault) +
                          ": no fault of a sensor; known: dead, stuck, stuck_low, stuck_high, gain, offset");
  }
  if (!entry.value) map.refuse(entry, "fault " + in_quotes(fault) + ": needs a value");
  if (fault == "stuck") return break_cell(cell, c, State::kStuck, *entry.value);
  if (!c.description.exact) calibrate(cell, c, fault == "gain" ? c.gain : c.offset, *entry.value);
}

void Imperfections::calibrate(std::size_t cell, const Channel& c, std::vector<float>& of, double value) {
  any_ = true;
  if (of.empty()) of.assign(cells_, &of == &c.gain ? 1.0F : 0.0F);
  of[cell] = static_cast<float>(value);
}

void Imperfections::read_calibration(const scene::CalibrationFile& file) {
  std::map<std::pair<std::size_t, std::string>, int> seen;
  for (const CsvLine& line : read_csv(file.name, file.text, "row,column,channel,gain,offset")) {
    const auto cell =
        static_cast<std::size_t>(line.index(0, "row", rows_) * columns_ + line.index(1, "column", columns_));
    const double gain = line.number(3, "gain"), offset = line.number(4, "offset");
    if (const auto [first, is_new] = seen.try_emplace({cell, line.text(2)}, line.line()); !is_new)
      line.refuse("the cell's channel is calibrated already, by line " + std::to_string(first->second));
    bool found = false;
    for (Channel& c : channels_) {
      if (c.description.exact || (!line.text(2).empty() && line.text(2) != c.description.name)) continue;
      found = true;
      calibrate(cell, c, c.gain, gain);
      calibrate(cell, c, c.offset, offset);
    }
    if (found) continue;
    std::string known;
    for (const Channel& c : channels_)
      if (!c.description.exact) known += (known.empty() ? "" : ", ") + c.description.name;
    line.refuse("channel " + in_quotes(line.text(2)) +
                ": the sensor has no such channel to calibrate; known: " + (known.empty() ? "none" : known));
  }
}

void Imperfections::apply(std::uint64_t tick, std::span<const std::span<const float>> truth,
                          WorkerPool& pool) {
  assert(truth.size() == channels_.size());
  for (std::size_t k = 0; k < channels_.size(); ++k) {
    Channel& c = channels_[k];
    c.truth = truth[k];
    if (c.past.empty()) continue;
    const std::size_t slots = c.past.size();
    std::ranges::copy(truth[k], c.past[tick % slots].begin());
    c.truth = c.past[tick < slots ? 0 : (tick + 1) % slots];
  }
  const double cost_ns = kCost_ns * static_cast<double>(cells_ * channels_.size());
  pool.for_rows(rows_, cost_ns, [this, tick](int begin, int end) {
    const auto columns = static_cast<std::size_t>(columns_);
    read_cells(tick, static_cast<std::size_t>(begin) * columns, static_cast<std::size_t>(end) * columns);
  });
}

void Imperfections::read_cells(std::uint64_t tick, std::size_t first, std::size_t last) noexcept {
  for (Channel& c : channels_) read_channel(tick, c, first, last);
  if (dropout_ <= 0.0) return;
  const CounterRandom lost(seed_, channels_.front().stream + kDropout, tick);
  for (std::size_t cell = first; cell < last; ++cell) {
    if (lost.uniform(cell) >= dropout_) continue;
    for (Channel& c : channels_)
      for (std::size_t at = cell; at < c.readings.size(); at += cells_)
        c.readings[at] = static_cast<float>(c.description.none);
  }
}

void Imperfections::read_channel(std::uint64_t tick, Channel& c, std::size_t first,
                                 std::size_t last) noexcept {
  const CounterRandom noise(seed_, c.stream + kNoise, tick), drift(seed_, c.stream + kDrift, tick);
  const double step_of_walk = drift_ * std::sqrt(period_s_);
  const auto none = static_cast<float>(c.description.none);
  const float* const mask = mask_ < 0 ? nullptr : channels_[static_cast<std::size_t>(mask_)].truth.data();
  for (std::size_t plane = 0; plane < c.readings.size(); plane += cells_)
    for (std::size_t cell = first; cell < last; ++cell) {
      const std::size_t at = plane + cell;
      float reading = c.truth[at];
      if (!c.description.exact) {
        if (!c.walk.empty() && tick > 0) c.walk[at] += static_cast<float>(step_of_walk * drift.normal(at));
        double value = reading;
        if (!c.gain.empty()) value *= c.gain[cell];
        if (!c.offset.empty()) value += c.offset[cell];
        if (!c.walk.empty()) value += c.walk[at];
        if (noise_ > 0.0) value += noise_ * noise.normal(at);
        if (quantize_ > 0.0) value = std::round(value / quantize_) * quantize_;
        reading = mask != nullptr && mask[cell] == 0.0F ? none : within(c.description, value);
      }
      if (!c.state.empty() && c.state[cell] != State::kWorks)
        reading = c.state[cell] == State::kDead ? none : c.stuck[cell];
      c.readings[at] = reading;
    }
}

}  // namespace smartsurf::surface
