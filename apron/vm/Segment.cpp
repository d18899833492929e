#include "apron/vm/Segment.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "apron/vm/ScalarKernels.h"

namespace apron::vm {

using program::BoundaryRule;

namespace {

constexpr std::int64_t kLane = kLanes;

std::int64_t lanes_down(std::int64_t n) { return n / kLane * kLane; }
std::int64_t lanes_up(std::int64_t n) { return (n + kLane - 1) / kLane * kLane; }

}  // namespace

Segment::Segment(const Trace& trace, Graph graph, Plan plan, const Machine& machine)
    : exit_(trace.exit),
      steps_(trace.path.size()),
      masks_(trace.masks),
      calls_(trace.calls),
      graph_(std::move(graph)),
      plan_(std::move(plan)),
      executor_(machine.executor),
      storage_(machine.storage),
      fresh_(machine.fresh),
      clean_pads_(machine.clean_pads) {
  for (const Stage& stage : plan_.stages) {
    jits_.push_back(machine.jit ? StageJit::make(stage, common_vectors(stage), plan_.rows_at_once)
                                : std::nullopt);
    tiles_.emplace_back(stage, plan_.stores, executor_.kernels());
  }
  allocate_workers();
}

void Segment::allocate_workers() {
  std::size_t scratch = 0;
  for (std::size_t s = 0; s < tiles_.size(); ++s)
    if (!jits_[s]) scratch = std::max(scratch, tiles_[s].scratch_floats());
  const std::size_t rings = (plan_.worker_floats + 2 * kLanes + kLanes - 1) / kLanes * kLanes;
  worker_floats_ = rings + scratch + kLanes;
  workers_.resize(plan_.threads);
  for (Worker& worker : workers_) {
    worker.rings = memory_.add(static_cast<std::uint32_t>(worker_floats_), 1).data;
    worker.tile = worker.rings + rings;
    worker.places.resize(plan_.stores.size());
  }
  const std::size_t columns = plan_.width + 4 * kLanes;
  outside_ = memory_.add(static_cast<std::uint32_t>(columns), 1).data;
  const float value = plan_.edge.rule == BoundaryRule::kValue ? plan_.edge.value : 0.0F;
  std::fill_n(outside_, columns, value);
  outside_ += 2 * kLanes;
  number_cells();
  for (Worker& worker : workers_) {
    find_places(worker, {});
    fill_margins(worker);
  }
  // With one strip the edges of the rings stay where they are.
  if (constant_edge() && plan_.strip_columns == plan_.width)
    for (const Worker& worker : workers_) pad_rings(worker, {0, plan_.width, 0});
}

void Segment::number_cells() {
  for (const Store& store : plan_.stores) {
    const bool columns = store.kind == Store::Kind::kColumns;
    if (!columns && store.kind != Store::Kind::kRows) continue;
    Plane& plane = columns ? columns_ : rows_;
    plane = memory_.add(plan_.width, columns ? 1 : plan_.height);
    for (std::uint32_t y = 0; y < plane.height; ++y) {
      for (std::uint32_t x = 0; x < plane.width; ++x) plane.row(y)[x] = static_cast<float>(columns ? x : y);
      pad_row(plane.row(y), store.pads, true, true);
    }
    number_floats_ += plane.cells();
  }
}

std::vector<std::uint32_t> Segment::fresh_registers() const {
  std::vector<std::uint32_t> registers;
  for (const Store& store : plan_.stores)
    if (store.kind == Store::Kind::kFresh) registers.push_back(store.reg);
  return registers;
}

std::size_t Segment::memory_bytes() const noexcept {
  return (worker_floats_ * plan_.threads + number_floats_) * sizeof(float);
}

// What lies beyond the edges of a ring is the same whatever the stages write: their rows are whole vectors.
bool Segment::constant_edge() const noexcept {
  return (plan_.edge.rule == BoundaryRule::kZero || plan_.edge.rule == BoundaryRule::kValue) &&
         plan_.width % kLanes == 0;
}

void Segment::run(const ConstPlane& mask) noexcept {
  scalars();
  for (Worker& worker : workers_) find_places(worker, mask);
  if (!clean_pads_) fill_input_pads();
  if (workers_.size() == 1) {
    for (unsigned slice = 0; slice < plan_.slices; ++slice) run_slice(slice, workers_[0]);
  } else {
    executor_.pieces(plan_.slices,
                     [this](std::uint32_t slice, unsigned thread) { run_slice(slice, workers_[thread]); });
  }
  for (const Store& store : plan_.stores)
    if (store.kind == Store::Kind::kFresh) std::swap(storage_.registers[store.reg], fresh_[store.reg]);
  for (const auto& [variable, slot] : graph_.stores) *variable = graph_.slots[slot];
}

void Segment::columns_of(const Stage& stage, const Strip& strip, std::int64_t& west,
                         std::int64_t& east) const noexcept {
  west = std::max<std::int64_t>(0, lanes_down(strip.first - stage.border_x + kLane) - kLane);
  east = std::min<std::int64_t>(plan_.width, strip.last + stage.border_x);
}

// The largest number of vectors that divides the stage's columns in every strip.
std::uint32_t Segment::common_vectors(const Stage& stage) const noexcept {
  std::int64_t common = 0;
  for (std::int64_t column = 0; column < plan_.width; column += plan_.strip_columns) {
    std::int64_t west = 0, east = 0;
    columns_of(stage, {column, std::min<std::int64_t>(column + plan_.strip_columns, plan_.width), 0}, west,
               east);
    common = std::gcd(common, lanes_up(east - west) / kLane);
  }
  return static_cast<std::uint32_t>(common);
}

void Segment::fill_margins(const Worker& worker) noexcept {
  const float value = plan_.edge.rule == BoundaryRule::kValue ? plan_.edge.value : 0.0F;
  for (const Place& place : worker.places)
    for (std::int64_t k = 1; k <= place.margin; ++k)
      for (const std::int64_t row : {-k, static_cast<std::int64_t>(plan_.height) - 1 + k})
        std::fill_n(place.data + row * place.pitch - kLane, place.pitch + kLane, value);
}

void Segment::scalars() noexcept {
  for (const auto& [slot, variable] : graph_.loads) graph_.slots[slot] = *variable;
  for (const ScalarStep& step : graph_.scalar_steps)
    graph_.slots[step.to] =
        evaluate(step.op, graph_.slots[step.from[0]], graph_.slots[step.from[1]], graph_.slots[step.from[2]]);
}

void Segment::find_places(Worker& worker, const ConstPlane& mask) const noexcept {
  for (std::size_t i = 0; i < plan_.stores.size(); ++i) {
    const Store& store = plan_.stores[i];
    Place& place = worker.places[i];
    switch (store.kind) {
      case Store::Kind::kRegister:
      case Store::Kind::kInPlace:
        place = {storage_.registers[store.reg].data, storage_.registers[store.reg].pitch, 0, 0};
        break;
      case Store::Kind::kFresh:
        if (!fresh_.empty()) place = {fresh_[store.reg].data, fresh_[store.reg].pitch, 0, 0};
        break;
      case Store::Kind::kMask:
        // Only read: results never go to a mask.
        place = {const_cast<float*>(mask.data), mask.pitch, 0, 0};
        break;
      case Store::Kind::kColumns:
        place = {columns_.data, 0, 0, 0};
        break;
      case Store::Kind::kRows:
        place = {rows_.data, rows_.pitch, 0, 0};
        break;
      case Store::Kind::kRing:
        place = {worker.rings + store.offset + kLanes, static_cast<std::ptrdiff_t>(plan_.ring_pitch),
                 store.capacity, store.margin};
        break;
    }
  }
}

void Segment::fill_input_pads() noexcept {
  for (const Store& store : plan_.stores) {
    if (store.kind != Store::Kind::kRegister || store.pads == 0) continue;
    const Plane& plane = storage_.registers[store.reg];
    for (std::uint32_t y = 0; y < plan_.height; ++y) pad_row(plane.row(y), store.pads, true, true);
  }
}

// row: its first cell. Only what the rule makes of the row's own cells.
void Segment::pad_row(float* row, std::uint32_t reach, bool west, bool east) const noexcept {
  const std::ptrdiff_t width = plan_.width;
  for (std::ptrdiff_t k = 1; k <= static_cast<std::ptrdiff_t>(reach); ++k) {
    float w = plan_.edge.rule == BoundaryRule::kValue ? plan_.edge.value : 0.0F, e = w;
    if (plan_.edge.rule == BoundaryRule::kReplicate) {
      if (west) w = row[0];
      if (east) e = row[width - 1];
    } else if (plan_.edge.rule == BoundaryRule::kReflect) {
      if (west) w = row[k];
      if (east) e = row[width - 1 - k];
    }
    if (west) row[-k] = w;
    if (east) row[width - 1 + k] = e;
  }
}

float* Segment::cell(const Place& place, const Strip& strip, std::int64_t row,
                     std::int64_t column) const noexcept {
  if (place.capacity == 0) return place.data + row * place.pitch + column;
  return place.data + row % place.capacity * place.pitch + (column - strip.ring_first);
}

void Segment::pad_rings(const Worker& worker, const Strip& strip) const noexcept {
  const bool west = strip.ring_first == 0;
  const bool east = std::min<std::int64_t>(plan_.width, strip.last + plan_.border) == plan_.width;
  for (std::size_t i = 0; i < plan_.stores.size(); ++i)
    for (std::uint32_t r = 0; plan_.stores[i].pads > 0 && r < plan_.stores[i].capacity; ++r)
      pad_row(cell(worker.places[i], strip, r, 0), plan_.stores[i].pads, west, east);
}

void Segment::run_slice(unsigned slice, const Worker& worker) noexcept {
  const auto height = static_cast<std::int64_t>(plan_.height);
  const std::int64_t top = height * slice / plan_.slices, bottom = height * (slice + 1) / plan_.slices;
  std::int64_t border = 0, end = 0;
  for (const Stage& stage : plan_.stages) {
    border = std::max<std::int64_t>(border, stage.border_y);
    end = std::max(end, std::min<std::int64_t>(height, bottom + stage.border_y) + stage.lag);
  }
  for (std::int64_t column = 0; column < plan_.width; column += plan_.strip_columns) {
    const Strip strip{column, std::min<std::int64_t>(column + plan_.strip_columns, plan_.width),
                      std::max<std::int64_t>(0, column - plan_.border)};
    if (constant_edge() && plan_.strip_columns != plan_.width) pad_rings(worker, strip);
    for (std::int64_t row = std::max<std::int64_t>(0, top - border); row < end; row += plan_.block_rows)
      for (std::size_t s = 0; s < plan_.stages.size(); ++s) {
        const Stage& stage = plan_.stages[s];
        const std::int64_t first = std::max({std::int64_t{0}, top - stage.border_y, row - stage.lag});
        const std::int64_t last =
            std::min({height, bottom + stage.border_y, row - stage.lag + std::int64_t{plan_.block_rows}});
        if (first < last) run_stage(s, worker, strip, first, last);
      }
  }
}

void Segment::run_stage(std::size_t index, const Worker& worker, const Strip& strip, std::int64_t first,
                        std::int64_t last) noexcept {
  const Stage& stage = plan_.stages[index];
  std::int64_t west = 0, east = 0;
  columns_of(stage, strip, west, east);
  StageCall call;
  call.slots = graph_.slots.data();
  call.row_bytes = lanes_up(east - west) * static_cast<std::int64_t>(sizeof(float));
  while (first < last) {
    const StageJit::Code* code = jits_[index] ? &jits_[index]->code(last - first) : nullptr;
    const std::uint32_t rows = code != nullptr ? code->rows : 1;
    const std::vector<Stream>& lines = code != nullptr ? code->lines : stage.streams;
    call.turns = std::min((last - first) / rows, begin_turns(lines, rows, worker, strip, first, west, call));
    if (code != nullptr)
      code->run(&call);
    else
      tiles_[index].run(call, worker.tile);
    pad_results(stage, worker, strip, first, first + call.turns * rows, west, east);
    first += call.turns * rows;
  }
}

// Where the lines of a turn that begins at this row are; how many turns follow at the same steps.
std::int64_t Segment::begin_turns(const std::vector<Stream>& lines, std::uint32_t rows, const Worker& worker,
                                  const Strip& strip, std::int64_t row, std::int64_t column,
                                  StageCall& call) const noexcept {
  std::int64_t turns = std::numeric_limits<std::int64_t>::max();
  for (std::size_t s = 0; s < lines.size(); ++s) {
    std::ptrdiff_t pitch = 0;
    const std::int64_t follow =
        locate(lines[s], worker, strip, row + lines[s].dy, column, call.first[s], pitch);
    turns = std::min(turns, (follow - 1) / rows + 1);
    call.step_bytes[s] = pitch * rows * static_cast<std::ptrdiff_t>(sizeof(float));
  }
  return turns;
}

// Where the row is; the number of rows that follow at the same pitch.
std::int64_t Segment::locate(const Stream& stream, const Worker& worker, const Strip& strip, std::int64_t row,
                             std::int64_t column, float*& first, std::ptrdiff_t& pitch) const noexcept {
  const auto height = static_cast<std::int64_t>(plan_.height);
  const Place& place = worker.places[stream.store];
  pitch = place.pitch;
  if (row >= 0 && row < height) {
    if (place.capacity == 0) {
      first = place.data + row * place.pitch + column;
      return height - row;
    }
    const auto at = static_cast<std::uint32_t>(row);
    const std::uint32_t turn = at < place.capacity ? at : at % place.capacity;
    first = place.data + static_cast<std::ptrdiff_t>(turn) * place.pitch + (column - strip.ring_first);
    // A ring with a margin holds every row.
    return place.margin > 0 ? height + place.margin - row
                            : std::min<std::int64_t>(height - row, place.capacity - turn);
  }
  if (row >= -place.margin && row < height + place.margin) {
    first = place.data + row * place.pitch + (column - strip.ring_first);
    return height + place.margin - row;
  }
  switch (plan_.edge.rule) {
    case BoundaryRule::kReplicate:
      first = cell(place, strip, row < 0 ? 0 : height - 1, column);
      pitch = 0;
      break;
    case BoundaryRule::kReflect:
      first = cell(place, strip, row < 0 ? -row : 2 * (height - 1) - row, column);
      return 1;
    default:
      first = outside_;
      pitch = 0;
      break;
  }
  return row < 0 ? -row : std::numeric_limits<std::int64_t>::max();
}

void Segment::pad_results(const Stage& stage, const Worker& worker, const Strip& strip, std::int64_t first,
                          std::int64_t last, std::int64_t west, std::int64_t east) const noexcept {
  for (const Stage::Result& result : stage.results) {
    const std::uint32_t store = stage.streams[result.stream].store;
    const std::uint32_t reach = plan_.stores[store].pads;
    if (reach == 0) continue;
    const bool ring = plan_.stores[store].kind == Store::Kind::kRing;
    if (ring ? constant_edge() : clean_pads_) continue;
    for (std::int64_t row = first; row < last; ++row)
      pad_row(cell(worker.places[store], strip, row, 0), reach, west == 0, east == plan_.width);
  }
}

}  // namespace apron::vm
