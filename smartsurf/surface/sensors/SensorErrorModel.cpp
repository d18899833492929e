#include "smartsurf/surface/sensors/SensorErrorModel.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "common/hash/Fnv.h"
#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/surface/CsvTable.h"
#include "smartsurf/surface/sensors/CounterRandom.h"

namespace smartsurf::surface {
namespace {

// Approximate cost per value.
constexpr double kReadingCost_ns = 5.0;

// Random numbers for different purposes use different streams.
enum StreamPurpose : std::uint64_t { kNoise, kDrift, kDropout, kFaults, kPurposeCount };

// By the channel's name: adding sensors does not change the random numbers of the others.
std::uint64_t stream_id(const std::string& channel) { return common::fnv1a(channel) * kPurposeCount; }

double parameter_or_zero(const scene::ParameterValues& sensor_values,
                         const scene::ParameterValues& shared_values, const char* name) {
  if (const auto it = sensor_values.find(name); it != sensor_values.end()) return it->second.front();
  if (const auto it = shared_values.find(name); it != shared_values.end()) return it->second.front();
  return 0.0;
}

float clamp_to_range(const scene::SensorChannel& c, double value) {
  return static_cast<float>(std::clamp(value, c.minimum, c.maximum));
}

}  // namespace

SensorErrorModel::SensorErrorModel(const scene::SensorSpec& spec, const scene::SceneSpec& scene,
                                   const FaultMap& map)
    : rows_(scene.surface.rows),
      columns_(scene.surface.columns),
      cells_(scene.surface.cell_count()),
      period_s_(scene.world.control_period_s),
      seed_(scene.world.seed) {
  const scene::ParameterValues& shared_values = scene.surface.faults.sensor_errors;
  const scene::SensorKind& kind = *scene::find_sensor_kind(spec.model);
  mask_ = kind.mask_channel;
  for (scene::SensorChannel& c : kind.channels(spec)) {
    ChannelState channel;
    channel.stream = stream_id(c.name);
    channel.description = std::move(c);
    channels_.push_back(std::move(channel));
  }
  noise_ = parameter_or_zero(spec.values, shared_values, "noise");
  quantize_ = parameter_or_zero(spec.values, shared_values, "quantize");
  drift_ = parameter_or_zero(spec.values, shared_values, "drift");
  dropout_ = parameter_or_zero(spec.values, shared_values, "dropout");
  if (kind.has_false_hits()) false_hits_ = parameter_or_zero(spec.values, shared_values, "false_hits");
  latency_ = static_cast<int>(parameter_or_zero(spec.values, shared_values, "latency"));
  draw_faults(spec.values, shared_values);
  load_fault_map(map);
  if (spec.calibration) load_calibration(*spec.calibration);
  const bool has_measured_channel =
      std::ranges::any_of(channels_, [](const ChannelState& c) { return !c.description.is_exact; });
  if (has_measured_channel && (noise_ > 0.0 || quantize_ > 0.0 || drift_ > 0.0)) active_ = true;
  if (dropout_ > 0.0 || latency_ > 0 || false_hits_ > 0.0) active_ = true;
  const ChannelState& measured = channels_.front();
  const bool has_value_errors = noise_ > 0.0 || quantize_ > 0.0 || drift_ > 0.0 || false_hits_ > 0.0 ||
                                !measured.gain.empty() || !measured.offset.empty();
  mask_follows_readings_ = mask_ > 0 && !measured.description.is_exact && has_value_errors;
  if (active_) allocate_buffers();
}

// Allocates everything that apply() needs.
void SensorErrorModel::allocate_buffers() {
  for (ChannelState& c : channels_) {
    const std::size_t numbers = cells_ * c.description.components;
    c.readings.resize(numbers);
    if (drift_ > 0.0 && !c.description.is_exact) c.drift.assign(numbers, 0.0F);
    if (latency_ > 0) c.delay_line.assign(latency_ + 1, std::vector<float>(numbers));
  }
}

// One draw per cell, so that a larger fraction selects a superset of the cells.
void SensorErrorModel::draw_faults(const scene::ParameterValues& sensor_values,
                                   const scene::ParameterValues& shared_values) {
  const double dead = parameter_or_zero(sensor_values, shared_values, "dead"),
               low = parameter_or_zero(sensor_values, shared_values, "stuck_low"),
               high = parameter_or_zero(sensor_values, shared_values, "stuck_high");
  if (dead + low + high <= 0.0) return;
  const CounterRandom random(seed_, channels_.front().stream + kFaults, 0);
  for (std::size_t cell = 0; cell < cells_; ++cell) {
    const double drawn = random.uniform(cell);
    for (ChannelState& c : channels_) {
      const scene::SensorChannel& measured = measured_channel(c);
      if (drawn < dead)
        set_cell_fault(cell, c, CellState::kDead, 0.0, measured);
      else if (drawn < dead + low)
        set_cell_fault(cell, c, CellState::kStuck, measured.minimum, measured);
      else if (drawn < dead + low + high)
        set_cell_fault(cell, c, CellState::kStuck, measured.maximum, measured);
    }
  }
}

// Returns the channel that defines the range of `c`; a mask refers to the first channel.
const scene::SensorChannel& SensorErrorModel::measured_channel(const ChannelState& c) const {
  return is_mask(c) ? channels_.front().description : c.description;
}

// value: of the channel `of`, which is c or, for a mask, what it masks: the mask is then stuck at whether
// that value is a detection.
void SensorErrorModel::set_cell_fault(std::size_t cell, ChannelState& c, CellState state, double value,
                                      const scene::SensorChannel& of) {
  active_ = true;
  if (c.state.empty()) {
    c.state.assign(cells_, CellState::kWorking);
    c.stuck_value.assign(cells_, 0.0F);
  }
  c.state[cell] = state;
  const float reading = clamp_to_range(of, value);
  c.stuck_value[cell] =
      &of == &c.description ? reading : static_cast<float>(reading != clamp_to_range(of, of.no_detection));
}

void SensorErrorModel::load_fault_map(const FaultMap& map) {
  for (const FaultEntry& entry : map.entries()) {
    const bool names_channel = std::ranges::any_of(
        channels_, [&](const ChannelState& c) { return c.description.name == entry.channel; });
    if (!names_channel && !entry.channel.empty()) continue;
    // A fault of a channel breaks the sensor's mask as well.
    for (ChannelState& c : channels_)
      if (!names_channel || c.description.name == entry.channel || is_mask(c)) apply_fault(map, entry, c);
  }
}

// An entry without a channel applies to actuators as well, so faults unknown to sensors are ignored in it.
void SensorErrorModel::apply_fault(const FaultMap& map, const FaultEntry& entry, ChannelState& c) {
  const int cell = entry.row * columns_ + entry.column;
  const std::string& fault = entry.fault;
  const bool is_named = entry.channel == c.description.name;
  const scene::SensorChannel& of = is_named ? c.description : measured_channel(c);
  if (fault == "dead") return set_cell_fault(cell, c, CellState::kDead, 0.0, of);
  if (fault == "stuck_low") return set_cell_fault(cell, c, CellState::kStuck, of.minimum, of);
  if (fault == "stuck_high") return set_cell_fault(cell, c, CellState::kStuck, of.maximum, of);
  if (fault != "stuck" && fault != "gain" && fault != "offset") {
    if (entry.channel.empty()) return;
    map.refuse_fault(entry, "a sensor", kSensorFaults);
  }
  if (!entry.value) map.refuse(entry, "fault " + quote(fault) + ": needs a value");
  if (fault == "stuck" && is_named && is_mask(c) && *entry.value != 0.0 && *entry.value != 1.0)
    map.refuse(entry, "value of 'stuck' = " + scene::format_number(*entry.value) + ": must be 0 or 1");
  if (fault == "stuck") return set_cell_fault(cell, c, CellState::kStuck, *entry.value, of);
  if (is_named && c.description.is_exact)
    map.refuse(entry, "fault " + quote(fault) + ": channel " + quote(entry.channel) + " has no " + fault);
  if (!c.description.is_exact) set_calibration(cell, c, fault == "gain" ? c.gain : c.offset, *entry.value);
}

void SensorErrorModel::set_calibration(std::size_t cell, const ChannelState& c, std::vector<float>& of,
                                       double value) {
  active_ = true;
  if (of.empty()) of.assign(cells_, &of == &c.gain ? 1.0F : 0.0F);
  of[cell] = static_cast<float>(value);
}

void SensorErrorModel::load_calibration(const scene::CalibrationFile& file) {
  std::map<std::pair<std::size_t, std::string>, int> seen;
  for (const CsvRow& row : read_csv(file.name, file.text, "row,column,channel,gain,offset")) {
    const std::size_t cell = row.index(0, "row", rows_) * columns_ + row.index(1, "column", columns_);
    const double gain = row.number(3, "gain"), offset = row.number(4, "offset");
    if (const auto [first, is_new] = seen.try_emplace({cell, row.text(2)}, row.line_number()); !is_new)
      row.refuse("the cell's channel is calibrated already, by line " + std::to_string(first->second));
    bool found = false;
    for (ChannelState& c : channels_) {
      if (c.description.is_exact || (!row.text(2).empty() && row.text(2) != c.description.name)) continue;
      found = true;
      set_calibration(cell, c, c.gain, gain);
      set_calibration(cell, c, c.offset, offset);
    }
    if (found) continue;
    std::string known;
    for (const ChannelState& c : channels_)
      if (!c.description.is_exact) known += (known.empty() ? "" : ", ") + c.description.name;
    row.refuse("channel " + quote(row.text(2)) +
               ": the sensor has no such channel to calibrate; known: " + (known.empty() ? "none" : known));
  }
}

void SensorErrorModel::apply(std::uint64_t tick, std::span<const std::span<const float>> truth,
                             common::ThreadPool& pool) {
  assert(truth.size() == channels_.size());
  for (std::size_t k = 0; k < channels_.size(); ++k) {
    ChannelState& c = channels_[k];
    c.truth = truth[k];
    if (c.delay_line.empty()) continue;
    const std::size_t slots = c.delay_line.size();
    std::ranges::copy(truth[k], c.delay_line[tick % slots].begin());
    c.truth = c.delay_line[tick < slots ? 0 : (tick + 1) % slots];
  }
  const double cost_ns = kReadingCost_ns * static_cast<double>(cells_ * channels_.size());
  pool.parallel_for_rows(rows_, cost_ns, [this, tick](int begin, int end) {
    compute_readings(tick, begin * columns_, end * columns_);
  });
}

void SensorErrorModel::compute_readings(std::uint64_t tick, std::size_t first, std::size_t last) noexcept {
  for (ChannelState& c : channels_) compute_channel(tick, c, first, last);
  if (mask_follows_readings_) compute_mask(first, last);
  if (dropout_ <= 0.0) return;
  const CounterRandom dropout_random(seed_, channels_.front().stream + kDropout, tick);
  for (std::size_t cell = first; cell < last; ++cell) {
    if (dropout_random.uniform(cell) >= dropout_) continue;
    for (ChannelState& c : channels_)
      for (std::size_t index = cell; index < c.readings.size(); index += cells_)
        c.readings[index] = static_cast<float>(c.description.no_detection);
  }
}

// A measured value at the limit of the range is not a detection.
void SensorErrorModel::compute_mask(std::size_t first, std::size_t last) noexcept {
  ChannelState& mask = channels_[mask_];
  const ChannelState& measured = channels_.front();
  const auto none = static_cast<float>(measured.description.no_detection);
  for (std::size_t cell = first; cell < last; ++cell)
    if (mask.state.empty() || mask.state[cell] == CellState::kWorking)
      mask.readings[cell] = measured.readings[cell] != none ? 1.0F : 0.0F;
}

float SensorErrorModel::false_reading(const scene::SensorChannel& c, double uniform) const noexcept {
  const double value = c.minimum + (c.maximum - c.minimum) * uniform;
  return clamp_to_range(c, quantize_ > 0.0 ? std::floor(value / quantize_) * quantize_ : value);
}

void SensorErrorModel::compute_channel(std::uint64_t tick, ChannelState& c, std::size_t first,
                                       std::size_t last) noexcept {
  const CounterRandom noise_random(seed_, c.stream + kNoise, tick),
      drift_random(seed_, c.stream + kDrift, tick);
  const double drift_step = drift_ * std::sqrt(period_s_);
  const auto none = static_cast<float>(c.description.no_detection);
  const ChannelState* const mask = mask_ < 0 ? nullptr : &channels_[mask_];
  // A mask has no noise: its stream is free for the false hits.
  const CounterRandom false_hit_random(seed_, (mask == nullptr ? c : *mask).stream + kNoise, tick);
  for (std::size_t plane = 0; plane < c.readings.size(); plane += cells_)
    for (std::size_t cell = first; cell < last; ++cell) {
      const std::size_t index = plane + cell;
      float reading = c.truth[index];
      if (!c.description.is_exact) {
        if (!c.drift.empty() && tick > 0)
          c.drift[index] += static_cast<float>(drift_step * drift_random.normal(index));
        if (mask != nullptr && mask->truth[cell] == 0.0F) {
          const bool is_false_hit = false_hits_ > 0.0 && false_hit_random.uniform(cell) < false_hits_;
          reading = is_false_hit ? false_reading(c.description, noise_random.uniform(index)) : none;
        } else {
          double value = reading;
          if (!c.gain.empty()) value *= c.gain[cell];
          if (!c.offset.empty()) value += c.offset[cell];
          if (!c.drift.empty()) value += c.drift[index];
          if (noise_ > 0.0) value += noise_ * noise_random.normal(index);
          if (quantize_ > 0.0) value = std::round(value / quantize_) * quantize_;
          reading = clamp_to_range(c.description, value);
        }
      }
      if (!c.state.empty() && c.state[cell] != CellState::kWorking)
        reading = c.state[cell] == CellState::kDead ? none : c.stuck_value[cell];
      c.readings[index] = reading;
    }
}

}  // namespace smartsurf::surface
