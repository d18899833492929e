#include "apron/vm/Plan.h"

#include <algorithm>
#include <map>

#include "apron/vm/PlaneStore.h"
#include "apron/vm/Stages.h"
#include "apron/vm/WriteAround.h"

namespace apron::vm {
namespace {

using program::BoundaryRule;
using program::Opcode;
using Group = Stages::Group;

constexpr std::size_t kCacheFloats = 800 * 1024 / sizeof(float);  // for the rings, of the second-level cache
// Of a slice: at least so many rows, and so many for each row that a neighbour computes too; so many a
// thread.
constexpr std::uint32_t kLeastSliceRows = 128, kSliceBorders = 48, kMostSlicesEach = 4;
constexpr std::uint32_t kNowhere = UINT32_MAX;

std::uint32_t round_up(std::uint32_t n, std::uint32_t unit) { return (n + unit - 1) / unit * unit; }

class Planner {
 public:
  Planner(const Graph& graph, std::uint32_t width, std::uint32_t height, const PlanOptions& options)
      : graph_(graph),
        options_(options),
        stages_(find_stages(graph)),
        groups_(stages_.groups),
        stage_of_(stages_.stage_of),
        users_(stages_.users),
        store_of_(graph.nodes.size(), kNowhere) {
    plan_.width = width;
    plan_.height = height;
    plan_.edge = graph.edge;
    for (const std::vector<Use>& users : users_)
      for (const Use& use : users)
        farthest_ = std::max(farthest_, static_cast<std::uint32_t>(std::abs(use.dy)));
  }

  Plan run() {
    find_lags();
    find_borders();
    choose_tiles();
    place_values();
    write_stages();
    size_rings();
    write_around_caches(plan_);
    return std::move(plan_);
  }

 private:
  bool computed(std::uint32_t node) const { return graph_.nodes[node].computed(); }
  template <class With>
  void each_value(std::uint32_t node, const With& with) const {
    graph_.nodes[node].each_value(with);
  }

  bool crosses(std::uint32_t node) const {
    return std::any_of(users_[node].begin(), users_[node].end(),
                       [&](const Use& use) { return stage_of_[use.node] != stage_of_[node]; });
  }

  std::uint32_t ahead(int dy) const {
    if (graph_.edge.rule == BoundaryRule::kReflect) dy = std::abs(dy);
    return dy > 0 ? static_cast<std::uint32_t>(dy) : 0;
  }

  // Stages are in an order in which each comes after those that it reads from.
  void find_lags() {
    plan_.stages.resize(groups_.size());
    for (std::uint32_t s = 0; s < groups_.size(); ++s) {
      Stage& stage = plan_.stages[s];
      for (const std::uint32_t node : groups_[s])
        each_value(node, [&](const Arg& arg) {
          if (computed(arg.index) && stage_of_[arg.index] != s)
            stage.lag = std::max(stage.lag, plan_.stages[stage_of_[arg.index]].lag + ahead(arg.dy));
        });
      plan_.lag = std::max(plan_.lag, stage.lag);
    }
  }

  void find_borders() {
    for (std::uint32_t s = static_cast<std::uint32_t>(groups_.size()); s-- > 0;)
      for (const std::uint32_t node : groups_[s])
        each_value(node, [&](const Arg& arg) {
          if (!computed(arg.index) || stage_of_[arg.index] == s) return;
          Stage& from = plan_.stages[stage_of_[arg.index]];
          from.border_x = std::max(from.border_x,
                                   plan_.stages[s].border_x + static_cast<std::uint32_t>(std::abs(arg.dx)));
          from.border_y = std::max(from.border_y,
                                   plan_.stages[s].border_y + static_cast<std::uint32_t>(std::abs(arg.dy)));
        });
    std::uint32_t most = 0;
    for (const Stage& stage : plan_.stages) most = std::max(most, stage.border_x);
    plan_.border = round_up(most, kLanes);
  }

  // The last block in which a row of the value is read, as a lag: rows further behind are free.
  std::uint32_t last_need(std::uint32_t node) const {
    std::uint32_t last = plan_.stages[stage_of_[node]].lag;
    for (const Use& use : users_[node])
      if (stage_of_[use.node] != stage_of_[node])
        last = std::max(last,
                        plan_.stages[stage_of_[use.node]].lag + static_cast<std::uint32_t>(std::abs(use.dy)));
    return last;
  }

  // Values whose rows follow each other through the same memory: when a stage writes row r of the later one,
  // row r of the earlier one has been read for the last time.
  struct Ring {
    std::uint32_t first_lag = 0, last_need = 0, newest = 0;
  };

  bool may_follow(std::uint32_t old, std::uint32_t value) const {
    const std::uint32_t writer = stage_of_[value], lag = plan_.stages[writer].lag;
    if (stage_of_[old] >= writer || copied(old)) return false;
    return std::all_of(users_[old].begin(), users_[old].end(), [&](const Use& use) {
      if (stage_of_[use.node] == writer) return use.dx == 0 && use.dy == 0;
      return stage_of_[use.node] < writer &&
             lag >= plan_.stages[stage_of_[use.node]].lag + static_cast<std::uint32_t>(std::abs(use.dy));
    });
  }

  // The rings of all values that are kept in one, and which value is in which.
  std::vector<Ring> share_rings(const std::vector<std::uint32_t>& values,
                                std::vector<std::uint32_t>& ring_of) const {
    std::vector<Ring> rings;
    for (const std::uint32_t value : values) {
      const auto place = std::find_if(rings.begin(), rings.end(),
                                      [&](const Ring& ring) { return may_follow(ring.newest, value); });
      ring_of.push_back(static_cast<std::uint32_t>(place - rings.begin()));
      const std::uint32_t need = last_need(value);
      if (place == rings.end()) {
        rings.push_back({plan_.stages[stage_of_[value]].lag, need, value});
      } else {
        place->last_need = std::max(place->last_need, need);
        place->newest = value;
      }
    }
    return rings;
  }

  // Rows that the edge rule makes the same for good; only worth it where few rows share a call.
  std::uint32_t margin(const Ring& ring) const {
    const bool constant = graph_.edge.rule == BoundaryRule::kZero || graph_.edge.rule == BoundaryRule::kValue;
    return constant && capacity(ring, plan_.block_rows) == plan_.height ? farthest_ : 0;
  }

  std::uint32_t capacity(const Ring& ring, std::uint32_t block_rows) const {
    return std::min(block_rows + ring.last_need - ring.first_lag, plan_.height);
  }

  bool copied(std::uint32_t node) const {
    return std::any_of(copies_.begin(), copies_.end(), [&](const auto& c) { return c.first == node; });
  }

  std::vector<std::uint32_t> crossing_values() const {
    std::vector<std::uint32_t> values;
    for (const Group& group : groups_)
      for (const std::uint32_t node : group)
        if (crosses(node)) values.push_back(node);
    return values;
  }

  // More slices than threads, for a core is not always there: whoever is ahead takes more. But what slices
  // share is computed twice, and should be little of them; and where no cell asks a neighbour, memory is the
  // limit, which long runs of rows suit best.
  void choose_slices() {
    std::uint32_t border = 0;
    for (const Stage& stage : plan_.stages) border = std::max(border, stage.border_y);
    const std::uint32_t least_rows = std::max(kLeastSliceRows, kSliceBorders * border);
    const std::uint32_t most = border == 0 ? 1U : kMostSlicesEach;
    const std::uint32_t each = std::clamp(plan_.height / least_rows / options_.threads, 1U, most);
    const std::uint32_t wanted = options_.threads == 1 ? 1 : options_.threads * each;
    plan_.threads = options_.threads;
    plan_.slices = std::clamp(options_.slices > 0 ? options_.slices : wanted, 1U, plan_.height);
  }

  void choose_tiles() {
    const std::uint32_t whole = plan_.width;
    choose_slices();
    plan_.strip_columns = whole;
    plan_.block_rows = plan_.height;
    if (plan_.stages.size() > 1) {
      plan_.block_rows = std::clamp(8192U / std::min(whole, 1024U), 4U, 64U);
      std::vector<std::uint32_t> ring_of;
      std::size_t rows = 0;
      for (const Ring& ring : share_rings(crossing_values(), ring_of))
        rows += capacity(ring, plan_.block_rows);
      for (const std::uint32_t columns : {whole, 2048U, 1024U, 512U, 256U}) {
        if (columns > whole) continue;
        plan_.strip_columns = columns;
        const std::uint32_t border = columns < whole ? plan_.border : 0;
        if (rows * (columns + 2 * border + kLanes) <= kCacheFloats) break;
      }
    }
    if (options_.strip_columns > 0)
      plan_.strip_columns = std::min(round_up(options_.strip_columns, kLanes), whole);
    // Short rows are in the first-level cache, where a load costs less than finding the rows to share it.
    plan_.rows_at_once = plan_.strip_columns < 256 ? 1 : 4;
    if (options_.rows_at_once > 0) plan_.rows_at_once = options_.rows_at_once;
    if (options_.block_rows > 0) plan_.block_rows = std::min(options_.block_rows, plan_.height);
    if (plan_.strip_columns >= whole) {
      plan_.strip_columns = whole;
      plan_.border = 0;
    }
  }

  // ---- places ----
  std::uint32_t add_store(const Store& store) {
    plan_.stores.push_back(store);
    return static_cast<std::uint32_t>(plan_.stores.size() - 1);
  }

  // Whether rows and columns beyond its own share of the array are computed by the stage too, which other
  // shares own.
  bool overlaps(const Stage& stage) const {
    return (plan_.strip_columns < plan_.width && stage.border_x > 0) ||
           (plan_.slices > 1 && stage.border_y > 0);
  }

  static Store::Kind store_kind(Node::Kind kind) {
    switch (kind) {
      case Node::Kind::kMask:
        return Store::Kind::kMask;
      case Node::Kind::kColumn:
        return Store::Kind::kColumns;
      case Node::Kind::kRow:
        return Store::Kind::kRows;
      default:
        return Store::Kind::kRegister;
    }
  }

  void place_values() {
    std::map<std::uint32_t, std::uint32_t> inputs;  // register: its node
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      const Node& node = graph_.nodes[i];
      if (node.kind == Node::Kind::kRegister) inputs[node.reg] = i;
      Store store;
      store.reg = node.reg;
      store.kind = store_kind(node.kind);
      if (!computed(i)) store_of_[i] = add_store(store);
    }
    results_.resize(graph_.nodes.size());
    for (const Graph::Output& output : graph_.outputs) {
      const Stage& stage = plan_.stages[stage_of_[output.value]];
      Store store;
      store.reg = output.reg;
      const auto input = inputs.find(output.reg);
      const bool clear = input == inputs.end() || in_place(input->second, output.value);
      store.kind = clear ? Store::Kind::kInPlace : Store::Kind::kFresh;
      const std::uint32_t index = add_store(store);
      if (overlaps(stage)) {
        copies_.push_back({output.value, index});
      } else {
        results_[output.value].push_back(index);
        store_of_[output.value] = index;
      }
    }
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!computed(i) || store_of_[i] != kNowhere) continue;
      if (!crosses(i) && !copied(i)) continue;
      store_of_[i] = add_store({});
      results_[i].push_back(store_of_[i]);
    }
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      for (const Use& use : users_[i])
        if (use.dx != 0) {
          std::uint32_t& pads = plan_.stores[store_of_[i]].pads;
          pads = std::max(pads, static_cast<std::uint32_t>(std::abs(use.dx)));
        }
  }

  // Whether every read of the register's old value is of the own cell and comes no later than the write of
  // the new.
  bool in_place(std::uint32_t input, std::uint32_t value) const {
    const std::uint32_t writer = stage_of_[value];
    if (overlaps(plan_.stages[writer])) return false;
    return std::all_of(users_[input].begin(), users_[input].end(), [&](const Use& use) {
      const Stage& reader = plan_.stages[stage_of_[use.node]];
      return use.dx == 0 && use.dy == 0 && stage_of_[use.node] <= writer &&
             reader.lag <= plan_.stages[writer].lag && !overlaps(reader);
    });
  }

  std::uint32_t stream(Stage& stage, std::uint32_t store, int dy) {
    const Stream wanted{store, static_cast<std::int8_t>(dy)};
    const auto found = std::find(stage.streams.begin(), stage.streams.end(), wanted);
    if (found == stage.streams.end()) stage.streams.push_back(wanted);
    return static_cast<std::uint32_t>(std::find(stage.streams.begin(), stage.streams.end(), wanted) -
                                      stage.streams.begin());
  }

  void write_stages() {
    for (std::uint32_t s = 0; s < groups_.size(); ++s) write_stage(s);
    for (const auto& [value, store] : copies_) {
      Stage copy;
      copy.lag = plan_.stages[stage_of_[value]].lag;
      copy.ops.push_back(
          {Opcode::kCopy, {{{MicroArg::Kind::kStream, 0, stream(copy, store_of_[value], 0)}}}});
      copy.results.push_back({0, stream(copy, store, 0)});
      plan_.stages.push_back(copy);
    }
  }

  void write_stage(std::uint32_t s) {
    Stage& stage = plan_.stages[s];
    std::map<std::uint32_t, std::uint32_t> op_of;
    for (const std::uint32_t node : groups_[s]) {
      MicroOp op{graph_.nodes[node].op, {}};
      for (std::size_t k = 0; k < op.args.size(); ++k) {
        const Arg& arg = graph_.nodes[node].args[k];
        if (arg.kind == Arg::Kind::kScalar) {
          op.args[k] = {MicroArg::Kind::kScalar, 0, arg.index};
        } else if (arg.kind == Arg::Kind::kValue) {
          const bool own = stage_of_[arg.index] == s && computed(arg.index);
          op.args[k] =
              own ? MicroArg{MicroArg::Kind::kTemp, 0, op_of[arg.index]}
                  : MicroArg{MicroArg::Kind::kStream, arg.dx, stream(stage, store_of_[arg.index], arg.dy)};
        }
      }
      op_of[node] = static_cast<std::uint32_t>(stage.ops.size());
      stage.ops.push_back(op);
    }
    for (const std::uint32_t node : groups_[s])
      for (const std::uint32_t store : results_[node])
        stage.results.push_back({op_of[node], stream(stage, store, 0)});
  }

  void size_rings() {
    // What lies east of a row and west of the next share the floats between them, as in every plane.
    plan_.ring_pitch = round_up(plan_.strip_columns, kLanes) + 2 * plan_.border + kLanes;
    std::vector<std::uint32_t> values, ring_of;
    for (const Group& group : groups_)
      for (const std::uint32_t node : group)
        if (store_of_[node] != kNowhere && plan_.stores[store_of_[node]].kind == Store::Kind::kRing)
          values.push_back(node);
    std::vector<std::size_t> offsets;
    std::size_t offset = 0;
    const std::vector<Ring> rings = share_rings(values, ring_of);
    for (const Ring& ring : rings) {
      // Rows at the same place of a page as the rows just written wait for them: rings begin apart.
      constexpr std::size_t kPage = 1024, kApart = 336;
      const std::size_t wanted = offsets.size() * kApart % kPage;
      offset += (wanted + kPage - offset % kPage) % kPage;
      const std::size_t above = std::size_t{margin(ring)} * plan_.ring_pitch;
      offsets.push_back(offset + above);
      offset += std::size_t{capacity(ring, plan_.block_rows)} * plan_.ring_pitch + 2 * above;
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      Store& store = plan_.stores[store_of_[values[i]]];
      store.capacity = capacity(rings[ring_of[i]], plan_.block_rows);
      store.offset = offsets[ring_of[i]];
      store.margin = margin(rings[ring_of[i]]);
    }
    plan_.worker_floats = offset + 2 * kLanes;
  }

  const Graph& graph_;
  const PlanOptions& options_;
  const Stages stages_;
  const std::vector<Group>& groups_;
  const std::vector<std::uint32_t>& stage_of_;
  const std::vector<std::vector<Use>>& users_;
  std::vector<std::uint32_t> store_of_;
  std::vector<std::vector<std::uint32_t>> results_;              // stores of each value
  std::vector<std::pair<std::uint32_t, std::uint32_t>> copies_;  // value, store
  std::uint32_t farthest_ = 0;                                   // rows that any operand is away
  Plan plan_;
};

}  // namespace

Plan make_plan(const Graph& graph, std::uint32_t width, std::uint32_t height, const PlanOptions& options) {
  return Planner(graph, width, height, options).run();
}

}  // namespace apron::vm
