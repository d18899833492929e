#include "apron/vm/fusion/FusionPlan.h"

#include <algorithm>
#include <map>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/fusion/NonTemporalStores.h"
#include "apron/vm/fusion/StagePartition.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;
using NodeGroup = StagePartition::NodeGroup;

// The rings' share of the second-level cache.
constexpr std::size_t kRingCacheBytes = 800 * 1024;
// A slice has at least kMinSliceRows rows, and at least kMinRowsPerHaloRow for each row of its halo.
constexpr std::uint32_t kMinSliceRows = 128, kMinRowsPerHaloRow = 48, kMaxSlicesPerThread = 4;
constexpr std::uint32_t kRowsPerIteration = 4;
constexpr std::uint32_t kBandRows = 24, kMaxBandHalo = 4;
constexpr std::uint32_t kNoBuffer = UINT32_MAX;

class FusionPlanner {
 public:
  FusionPlanner(const ValueGraph& graph, std::uint32_t width, std::uint32_t height,
                const FusionPlanOptions& options)
      : graph_(graph),
        options_(options),
        partition_(partition_stages(graph)),
        groups_(partition_.groups),
        stage_of_(partition_.stage_of),
        users_(partition_.users),
        buffer_of_(graph.nodes.size(), kNoBuffer),
        lanes_(lanes(graph.type)) {
    plan_.type = graph.type;
    plan_.width = width;
    plan_.height = height;
    plan_.boundary = graph.boundary;
    for (const std::vector<ValueUse>& users : users_)
      for (const ValueUse& use : users)
        max_row_offset_ = std::max(max_row_offset_, static_cast<std::uint32_t>(std::abs(use.dy)));
  }

  FusionPlan plan() {
    compute_skews(1);
    compute_halos();
    choose_tiles();
    assign_buffers();
    emit_stages();
    lay_out_rings();
    select_non_temporal_stores(plan_.stages, plan_.buffers,
                               std::size_t{plan_.width} * plan_.height * program::cell_bytes(plan_.type));
    return std::move(plan_);
  }

 private:
  bool is_computed(std::uint32_t node) const { return graph_.nodes[node].is_computed(); }

  bool is_used_across_stages(std::uint32_t node) const {
    return std::ranges::any_of(users_[node],
                               [&](const ValueUse& use) { return stage_of_[use.node] != stage_of_[node]; });
  }

  bool wraps() const { return graph_.boundary.rule == BoundaryRule::kWrap; }

  std::uint32_t rows_ahead(int dy) const {
    if (graph_.boundary.rule == BoundaryRule::kReflect) dy = std::abs(dy);
    return dy > 0 ? static_cast<std::uint32_t>(dy) : 0;
  }

  // Delays each stage until the rows that it reads ahead of its own have been computed, by multiples of
  // `unit` rows. Groups are in topological order.
  void compute_skews(std::uint32_t unit) {
    plan_.stages.resize(groups_.size());
    for (std::uint32_t s = 0; s < groups_.size(); ++s) {
      Stage& stage = plan_.stages[s];
      for (const std::uint32_t node : groups_[s])
        graph_.nodes[node].for_each_value([&](const ValueRef& arg) {
          if (is_computed(arg.index) && stage_of_[arg.index] != s)
            stage.skew = std::max(
                stage.skew, plan_.stages[stage_of_[arg.index]].skew + round_up(rows_ahead(arg.dy), unit));
        });
    }
  }

  void compute_halos() {
    for (std::uint32_t s = static_cast<std::uint32_t>(groups_.size()); s-- > 0;)
      for (const std::uint32_t node : groups_[s])
        graph_.nodes[node].for_each_value([&](const ValueRef& arg) {
          if (!is_computed(arg.index) || stage_of_[arg.index] == s) return;
          Stage& from = plan_.stages[stage_of_[arg.index]];
          from.halo_x =
              std::max(from.halo_x, plan_.stages[s].halo_x + static_cast<std::uint32_t>(std::abs(arg.dx)));
          from.halo_y =
              std::max(from.halo_y, plan_.stages[s].halo_y + static_cast<std::uint32_t>(std::abs(arg.dy)));
        });
    std::uint32_t max_halo = 0;
    for (const Stage& stage : plan_.stages) max_halo = std::max(max_halo, stage.halo_x);
    plan_.ring_halo = round_up(max_halo, lanes_);
  }

  // The largest skew at which a row of the value is read: rows further behind are dead.
  std::uint32_t last_use_skew(std::uint32_t node) const {
    std::uint32_t last = plan_.stages[stage_of_[node]].skew;
    for (const ValueUse& use : users_[node])
      if (stage_of_[use.node] != stage_of_[node])
        last = std::max(
            last, plan_.stages[stage_of_[use.node]].skew + static_cast<std::uint32_t>(std::abs(use.dy)));
    return last;
  }

  // A ring shared by values with disjoint live ranges: when a stage writes row r of the later value, row r of
  // the earlier one has been read for the last time.
  struct RingAllocation {
    std::uint32_t first_skew = 0, last_use_skew = 0, last_value = 0;
  };

  bool can_reuse_ring(std::uint32_t old, std::uint32_t value) const {
    const std::uint32_t writer = stage_of_[value], skew = plan_.stages[writer].skew;
    if (stage_of_[old] >= writer || is_copied(old)) return false;
    return std::ranges::all_of(users_[old], [&](const ValueUse& use) {
      if (stage_of_[use.node] == writer) return use.dx == 0 && use.dy == 0;
      if (stage_of_[use.node] < writer && is_single_block_) return true;
      return stage_of_[use.node] < writer &&
             skew >= plan_.stages[stage_of_[use.node]].skew + static_cast<std::uint32_t>(std::abs(use.dy));
    });
  }

  // Assigns each value to a ring, first fit. ring_of receives the ring index of each value.
  std::vector<RingAllocation> allocate_rings(const std::vector<std::uint32_t>& values,
                                             std::vector<std::uint32_t>& ring_of) const {
    std::vector<RingAllocation> rings;
    for (const std::uint32_t value : values) {
      const auto reusable_ring = std::ranges::find_if(
          rings, [&](const RingAllocation& ring) { return can_reuse_ring(ring.last_value, value); });
      ring_of.push_back(static_cast<std::uint32_t>(reusable_ring - rings.begin()));
      const std::uint32_t last_use = last_use_skew(value);
      if (reusable_ring == rings.end()) {
        rings.push_back({plan_.stages[stage_of_[value]].skew, last_use, value});
      } else {
        reusable_ring->last_use_skew = std::max(reusable_ring->last_use_skew, last_use);
        reusable_ring->last_value = value;
      }
    }
    return rings;
  }

  // Margin rows hold a constant boundary in a ring that holds the whole array, so that one call can run
  // across the edge.
  std::uint32_t margin_rows(const RingAllocation& ring) const {
    const bool constant =
        graph_.boundary.rule == BoundaryRule::kZero || graph_.boundary.rule == BoundaryRule::kValue;
    return constant && ring_rows(ring, plan_.block_rows) == plan_.height ? max_row_offset_ : 0;
  }

  std::uint32_t ring_rows(const RingAllocation& ring, std::uint32_t block_rows) const {
    if (has_whole_rings_) return plan_.height;
    const std::uint32_t rows = block_rows + ring.last_use_skew - ring.first_skew;
    return wraps() ? rows : std::min(rows, plan_.height);
  }

  bool is_copied(std::uint32_t node) const {
    return std::ranges::any_of(copies_, [&](const auto& c) { return c.first == node; });
  }

  std::vector<std::uint32_t> inter_stage_values() const {
    std::vector<std::uint32_t> values;
    for (const NodeGroup& group : groups_)
      for (const std::uint32_t node : group)
        if (is_used_across_stages(node)) values.push_back(node);
    return values;
  }

  // More slices than threads balance the load. But the halo of each slice is computed twice, so it must be a
  // small part of the slice. Without a halo, memory bandwidth is the limit, and long runs of rows are best.
  void choose_slices() {
    std::uint32_t halo = 0;
    for (const Stage& stage : plan_.stages) halo = std::max(halo, stage.halo_y);
    const std::uint32_t min_rows = std::max(kMinSliceRows, kMinRowsPerHaloRow * halo);
    const std::uint32_t max_slices_per_thread = halo == 0 ? 1U : kMaxSlicesPerThread;
    const std::uint32_t slices_per_thread =
        std::clamp(plan_.height / min_rows / options_.threads, 1U, max_slices_per_thread);
    const std::uint32_t wanted = options_.threads == 1 ? 1 : options_.threads * slices_per_thread;
    plan_.threads = options_.threads;
    plan_.slices = std::clamp(options_.slices > 0 ? options_.slices : wanted, 1U, plan_.height);
  }

  // One block of all rows that the stages compute, with their skews: each stage is one call. Where rings are
  // not shared, blocks of kBandRows instead, so that a stage finds the previous one's rows in the cache: each
  // stage is one call for each block, of whole iterations, because the rings hold all rows.
  void run_stages_one_by_one() {
    std::uint32_t halo = 0, skew = 0;
    for (const Stage& stage : plan_.stages) {
      halo = std::max(halo, stage.halo_y);
      skew = std::max(skew, stage.skew);
    }
    plan_.block_rows = plan_.height + 2 * halo + skew;
    is_single_block_ = true;
    const std::vector<std::uint32_t> values = inter_stage_values();
    std::vector<std::uint32_t> ring_of;
    const bool shares_rings = allocate_rings(values, ring_of).size() < values.size();
    if (shares_rings || wraps() || halo > kMaxBandHalo) return;
    is_single_block_ = false;
    has_whole_rings_ = true;
    plan_.block_rows = kBandRows;
    compute_skews(kRowsPerIteration);
  }

  void choose_tiles() {
    const std::uint32_t whole = plan_.width;
    choose_slices();
    plan_.strip_columns = whole;
    plan_.block_rows = plan_.height;
    if (plan_.stages.size() > 1) {
      const std::uint32_t density = lanes_ / kLanes;  // cells in the bytes of a float
      plan_.block_rows = std::clamp(8192U * density / std::min(whole, 1024U * density), 4U, 64U);
      if (options_.block_rows == 0 && plan_.height <= plan_.block_rows) run_stages_one_by_one();
      std::vector<std::uint32_t> ring_of;
      std::size_t rows = 0;
      for (const RingAllocation& ring : allocate_rings(inter_stage_values(), ring_of))
        rows += ring_rows(ring, plan_.block_rows);
      // Take the widest strip whose rings fit the cache.
      for (const std::uint32_t columns :
           {whole, 2048U * density, 1024U * density, 512U * density, 256U * density}) {
        if (columns > whole || (wraps() && columns != whole)) continue;
        plan_.strip_columns = columns;
        const std::uint32_t halo = columns < whole ? plan_.ring_halo : 0;
        if (rows * (columns + 2 * halo + lanes_) * program::cell_bytes(plan_.type) <= kRingCacheBytes) break;
      }
    }
    if (options_.strip_columns > 0 && !wraps())
      plan_.strip_columns = std::min(round_up(options_.strip_columns, lanes_), whole);
    plan_.rows_per_iteration =
        options_.rows_per_iteration > 0 ? options_.rows_per_iteration : kRowsPerIteration;
    if (options_.block_rows > 0) plan_.block_rows = std::min(options_.block_rows, plan_.height);
    if (plan_.strip_columns >= whole) {
      plan_.strip_columns = whole;
      plan_.ring_halo = 0;
    }
  }

  // ---- buffers ----
  std::uint32_t add_buffer(const RowBuffer& buffer) {
    plan_.buffers.push_back(buffer);
    return static_cast<std::uint32_t>(plan_.buffers.size() - 1);
  }

  // True if the stage also computes halo cells that belong to neighbouring strips or slices.
  bool recomputes_overlap(const Stage& stage) const {
    return (plan_.strip_columns < plan_.width && stage.halo_x > 0) ||
           ((plan_.slices > 1 || wraps()) && stage.halo_y > 0);
  }

  static RowBuffer::Kind buffer_kind(ValueNode::Kind kind) {
    switch (kind) {
      case ValueNode::Kind::kMask:
        return RowBuffer::Kind::kMask;
      case ValueNode::Kind::kColumnIndex:
        return RowBuffer::Kind::kColumnIndex;
      case ValueNode::Kind::kRowIndex:
        return RowBuffer::Kind::kRowIndex;
      default:
        return RowBuffer::Kind::kRegister;
    }
  }

  void assign_buffers() {
    // Inputs.
    std::map<std::uint32_t, std::uint32_t> inputs;  // register -> node
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      const ValueNode& node = graph_.nodes[i];
      if (node.kind == ValueNode::Kind::kRegister) inputs[node.reg] = i;
      RowBuffer buffer;
      buffer.reg = node.reg;
      buffer.kind = buffer_kind(node.kind);
      if (!is_computed(i)) buffer_of_[i] = add_buffer(buffer);
    }
    // Outputs. A stage that computes halo cells must not write them to a register, because they belong to
    // other strips or slices: such outputs go to a ring and are copied without the halo.
    result_buffers_.resize(graph_.nodes.size());
    for (const ValueGraph::Output& output : graph_.outputs) {
      const Stage& stage = plan_.stages[stage_of_[output.value]];
      RowBuffer buffer;
      buffer.reg = output.reg;
      const auto input = inputs.find(output.reg);
      const bool clear = input == inputs.end() || can_write_in_place(input->second, output.value);
      buffer.kind = clear ? RowBuffer::Kind::kInPlace : RowBuffer::Kind::kDoubleBuffered;
      const std::uint32_t index = add_buffer(buffer);
      if (recomputes_overlap(stage)) {
        copies_.push_back({output.value, index});
      } else {
        result_buffers_[output.value].push_back(index);
        buffer_of_[output.value] = index;
      }
    }
    // Intermediate values that other stages or copies read.
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!is_computed(i) || buffer_of_[i] != kNoBuffer) continue;
      if (!is_used_across_stages(i) && !is_copied(i)) continue;
      buffer_of_[i] = add_buffer({});
      result_buffers_[i].push_back(buffer_of_[i]);
    }
    // Padding for uses at west and east offsets.
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      for (const ValueUse& use : users_[i])
        if (use.dx != 0) {
          std::uint32_t& pad_columns = plan_.buffers[buffer_of_[i]].pad_columns;
          pad_columns = std::max(pad_columns, static_cast<std::uint32_t>(std::abs(use.dx)));
        }
  }

  // True if every read of the register's old value is at offset 0 and no later than the write of the new
  // value.
  bool can_write_in_place(std::uint32_t input, std::uint32_t value) const {
    const std::uint32_t writer = stage_of_[value];
    if (recomputes_overlap(plan_.stages[writer])) return false;
    return std::ranges::all_of(users_[input], [&](const ValueUse& use) {
      const Stage& reader = plan_.stages[stage_of_[use.node]];
      return use.dx == 0 && use.dy == 0 && stage_of_[use.node] <= writer &&
             reader.skew <= plan_.stages[writer].skew && !recomputes_overlap(reader);
    });
  }

  std::uint32_t get_or_add_stream(Stage& stage, std::uint32_t buffer, int dy) {
    const RowStream wanted{buffer, static_cast<std::int8_t>(dy)};
    const auto found = std::ranges::find(stage.streams, wanted);
    if (found == stage.streams.end()) stage.streams.push_back(wanted);
    return static_cast<std::uint32_t>(std::ranges::find(stage.streams, wanted) - stage.streams.begin());
  }

  void emit_stages() {
    for (std::uint32_t s = 0; s < groups_.size(); ++s) emit_stage(s);
    for (const auto& [value, store] : copies_) {
      Stage copy;
      copy.type = plan_.type;
      copy.skew = plan_.stages[stage_of_[value]].skew;
      copy.ops.push_back(
          {Opcode::kCopy,
           {{{MicroOperand::Kind::kStream, 0, get_or_add_stream(copy, buffer_of_[value], 0)}}}});
      copy.results.push_back({0, get_or_add_stream(copy, store, 0)});
      plan_.stages.push_back(copy);
    }
  }

  void emit_stage(std::uint32_t s) {
    Stage& stage = plan_.stages[s];
    stage.type = plan_.type;
    std::map<std::uint32_t, std::uint32_t> op_of;
    for (const std::uint32_t node : groups_[s]) {
      MicroOp op{graph_.nodes[node].op, {}};
      const ValueRef& distance = graph_.nodes[node].operands[1];
      if ((op.op == Opcode::kBitLeft || op.op == Opcode::kBitRight) &&
          distance.kind == ValueRef::Kind::kScalar && graph_.is_literal[distance.index] &&
          graph_.scalar_slots[distance.index] >= 0.0)
        op.immediate = static_cast<std::int64_t>(graph_.scalar_slots[distance.index]);
      for (std::size_t k = 0; k < op.operands.size(); ++k) {
        const ValueRef& arg = graph_.nodes[node].operands[k];
        if (arg.kind == ValueRef::Kind::kScalar) {
          op.operands[k] = {MicroOperand::Kind::kScalar, 0, arg.index};
        } else if (arg.kind == ValueRef::Kind::kValue) {
          const bool own = stage_of_[arg.index] == s && is_computed(arg.index);
          op.operands[k] = own ? MicroOperand{MicroOperand::Kind::kTemp, 0, op_of[arg.index]}
                               : MicroOperand{MicroOperand::Kind::kStream, arg.dx,
                                              get_or_add_stream(stage, buffer_of_[arg.index], arg.dy)};
        }
      }
      op_of[node] = static_cast<std::uint32_t>(stage.ops.size());
      stage.ops.push_back(op);
    }
    for (const std::uint32_t node : groups_[s])
      for (const std::uint32_t buffer : result_buffers_[node])
        stage.results.push_back({op_of[node], get_or_add_stream(stage, buffer, 0)});
  }

  void lay_out_rings() {
    // The padding east of a row is also the padding west of the next row, as in every plane.
    plan_.ring_pitch = round_up(plan_.strip_columns, lanes_) + 2 * plan_.ring_halo + lanes_;
    std::vector<std::uint32_t> values, ring_of;
    for (const NodeGroup& group : groups_)
      for (const std::uint32_t node : group)
        if (buffer_of_[node] != kNoBuffer && plan_.buffers[buffer_of_[node]].kind == RowBuffer::Kind::kRing)
          values.push_back(node);
    std::vector<std::size_t> offsets;
    std::size_t offset = 0;
    const std::vector<RingAllocation> rings = allocate_rings(values, ring_of);
    for (const RingAllocation& ring : rings) {
      // Loads that match a recent store in the page offset stall on it (4K aliasing), so rings are staggered.
      const std::size_t page = 4096 / program::cell_bytes(plan_.type),
                        stagger = 1344 / program::cell_bytes(plan_.type);
      const std::size_t wanted = offsets.size() * stagger % page;
      offset += (wanted + page - offset % page) % page;
      const std::size_t above = std::size_t{margin_rows(ring)} * plan_.ring_pitch;
      offsets.push_back(offset + above);
      offset += std::size_t{ring_rows(ring, plan_.block_rows)} * plan_.ring_pitch + 2 * above;
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      RowBuffer& buffer = plan_.buffers[buffer_of_[values[i]]];
      buffer.ring_rows = ring_rows(rings[ring_of[i]], plan_.block_rows);
      buffer.offset = offsets[ring_of[i]];
      buffer.margin_rows = margin_rows(rings[ring_of[i]]);
    }
    plan_.worker_cells = offset + 2 * std::size_t{lanes_};
  }

  const ValueGraph& graph_;
  const FusionPlanOptions& options_;
  const StagePartition partition_;
  const std::vector<NodeGroup>& groups_;
  const std::vector<std::uint32_t>& stage_of_;
  const std::vector<std::vector<ValueUse>>& users_;
  std::vector<std::uint32_t> buffer_of_;
  std::vector<std::vector<std::uint32_t>> result_buffers_;       // indexed by value: buffers that receive it
  std::vector<std::pair<std::uint32_t, std::uint32_t>> copies_;  // value, buffer
  std::uint32_t max_row_offset_ = 0;                             // largest |dy| of any operand
  bool is_single_block_ = false;                                 // each stage ends before the next one begins
  const std::uint32_t lanes_;
  bool has_whole_rings_ = false;  // of all rows, although there are several blocks
  FusionPlan plan_;
};

}  // namespace

FusionPlan make_fusion_plan(const ValueGraph& graph, std::uint32_t width, std::uint32_t height,
                            const FusionPlanOptions& options) {
  return FusionPlanner(graph, width, height, options).plan();
}

}  // namespace apron::vm
