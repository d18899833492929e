#include "apron/target_c/Schedule.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>

#include "common/index/UnionFind.h"

namespace apron::target_c {
namespace {

using program::BoundaryRule;
using program::Opcode;

constexpr std::uint32_t kNever = ~std::uint32_t{0};

// ---- which values are 0 or 1 ----

bool is_truth_literal(const Node& node) {
  return node.kind == NodeKind::kLiteral &&
         (node.literal == 1.0 || (node.literal == 0.0 && 1.0 / node.literal > 0.0));
}

bool is_truth_op(Opcode op) { return op >= Opcode::kLt && op <= Opcode::kNot; }

// Planes whose cells beyond the table's edge hold another number than 0 and 1.
std::vector<bool> find_numbers_beyond_edge(const Region& region) {
  std::vector<bool> numbers(region.nodes.size(), false);
  for (const Node& node : region.nodes)
    if (node.kind == NodeKind::kRead && node.rule == BoundaryRule::kValue &&
        !is_truth_literal(region.nodes[node.operands[1]]))
      numbers[node.operands[0]] = true;
  return numbers;
}

std::vector<bool> find_truths(const Region& region, const std::set<std::uint32_t>& number_homes) {
  std::vector<bool> truth(region.nodes.size(), false);
  const std::vector<bool> is_number = find_numbers_beyond_edge(region);
  for (NodeId id = 0; id < region.nodes.size(); ++id) {
    const Node& node = region.nodes[id];
    const auto is = [&](std::size_t k) { return truth[node.operands[k]]; };
    switch (node.kind) {
      case NodeKind::kLiteral:
        truth[id] = is_truth_literal(node);
        break;
      case NodeKind::kHome:
        truth[id] = number_homes.count(node.index) == 0;
        break;
      case NodeKind::kRead:
        truth[id] = is(0) && (node.rule != BoundaryRule::kValue || is(1));
        break;
      case NodeKind::kPlaneOp:
        switch (node.op) {
          case Opcode::kCopy:
          case Opcode::kConvert:
          case Opcode::kConvertSaturated:
            truth[id] = is(0);
            break;
          case Opcode::kMin:
          case Opcode::kMax:
          case Opcode::kMul:
          case Opcode::kBitAnd:
          case Opcode::kBitOr:
          case Opcode::kBitXor:
            truth[id] = is(0) && is(1);
            break;
          case Opcode::kSelect:
            truth[id] = is(1) && is(2);
            break;
          default:
            truth[id] = is_truth_op(node.op);
            break;
        }
        break;
      default:
        break;
    }
    if (is_number[id]) truth[id] = false;
  }
  return truth;
}

// Homes that may hold other values than 0 and 1.
std::set<std::uint32_t> find_number_homes(const std::vector<Region>& regions) {
  std::set<std::uint32_t> numbers;
  for (const Region& region : regions) {
    const std::vector<bool> is_number = find_numbers_beyond_edge(region);
    for (NodeId id = 0; id < region.nodes.size(); ++id)
      if (is_number[id] && region.nodes[id].kind == NodeKind::kHome) numbers.insert(region.nodes[id].index);
  }
  for (bool changed = true; changed;) {
    changed = false;
    for (const Region& region : regions) {
      const std::vector<bool> truth = find_truths(region, numbers);
      for (const auto& [home, id] : region.homes_out)
        if (!truth[id]) changed = numbers.insert(home).second || changed;
    }
  }
  return numbers;
}

// ---- which values are needed ----

struct Needs {
  std::set<std::uint32_t> homes, scalars;  // that the region reads where it begins
  std::vector<bool> nodes;
};

class Liveness {
 public:
  explicit Liveness(const std::vector<Region>& regions) : regions_(regions), needs_(regions.size()) {
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = regions.size(); i-- > 0;) changed = update(i) || changed;
    }
  }
  const Needs& of(std::size_t region) const { return needs_[region]; }
  // The homes and scalars that the regions that follow need.
  std::pair<std::set<std::uint32_t>, std::set<std::uint32_t>> after(std::size_t index) const {
    std::set<std::uint32_t> homes, scalars;
    const Region& region = regions_[index];
    for (std::size_t k = 0; k < region.successor_count(); ++k) {
      const Needs& next = needs_[region.next[k]];
      homes.insert(next.homes.begin(), next.homes.end());
      scalars.insert(next.scalars.begin(), next.scalars.end());
    }
    return {homes, scalars};
  }

 private:
  bool update(std::size_t index) {
    const Region& region = regions_[index];
    const auto [homes, scalars] = after(index);
    Needs needs;
    needs.nodes.assign(region.nodes.size(), false);
    const auto need = [&](NodeId id) {
      if (id != kNoNode) needs.nodes[id] = true;
    };
    for (const NodeId id : region.actuations) need(id);
    need(region.a);
    need(region.b);
    for (const std::uint32_t home : homes) {
      const auto found = region.homes_out.find(home);
      if (found != region.homes_out.end())
        need(found->second);
      else
        needs.homes.insert(home);
    }
    for (const std::uint32_t slot : scalars) {
      const auto found = region.scalars_out.find(slot);
      if (found != region.scalars_out.end())
        need(found->second);
      else
        needs.scalars.insert(slot);
    }
    for (NodeId id = static_cast<NodeId>(region.nodes.size()); id-- > 0;) {
      if (!needs.nodes[id]) continue;
      const Node& node = region.nodes[id];
      for (const NodeId operand : node.operands) need(operand);
      if (node.kind == NodeKind::kHome) needs.homes.insert(node.index);
      if (node.kind == NodeKind::kScalarEntry) needs.scalars.insert(node.index);
    }
    const bool changed = needs.homes != needs_[index].homes || needs.scalars != needs_[index].scalars ||
                         needs.nodes != needs_[index].nodes;
    needs_[index] = std::move(needs);
    return changed;
  }

  const std::vector<Region>& regions_;
  std::vector<Needs> needs_;
};

// A read beyond the table's edge finds the value that its rule gave the cells there; a value that is read by
// two rules is two.
void separate_rules(Region& region) {
  using Rule = std::tuple<BoundaryRule, NodeId>;
  std::vector<Node> nodes;
  std::vector<NodeId> renamed(region.nodes.size());
  std::map<NodeId, Rule> first_rule;  // by new number
  std::map<std::pair<NodeId, Rule>, NodeId> copies;
  for (NodeId id = 0; id < region.nodes.size(); ++id) {
    Node node = region.nodes[id];
    for (NodeId& operand : node.operands)
      if (operand != kNoNode) operand = renamed[operand];
    if (node.kind == NodeKind::kRead) {
      const Rule rule{node.rule, node.operands[1]};
      const NodeId value = node.operands[0];
      const auto [found, is_first] = first_rule.try_emplace(value, rule);
      if (!is_first && found->second != rule) {
        const auto [copy, is_new] = copies.try_emplace({value, rule}, static_cast<NodeId>(nodes.size()));
        if (is_new) {
          Node copied;
          copied.kind = NodeKind::kPlaneOp;
          copied.op = Opcode::kCopy;
          copied.type = region.nodes[id].type;
          copied.operands[0] = value;
          nodes.push_back(copied);
        }
        node.operands[0] = copy->second;
      }
    }
    renamed[id] = static_cast<NodeId>(nodes.size());
    nodes.push_back(node);
  }
  region.nodes = std::move(nodes);
  for (auto* out : {&region.homes_out, &region.scalars_out})
    for (auto& [index, id] : *out) id = renamed[id];
  for (NodeId& id : region.actuations) id = renamed[id];
  if (region.a != kNoNode) region.a = renamed[region.a];
  if (region.b != kNoNode) region.b = renamed[region.b];
}

// ---- rounds ----

// The sides of each corner.
constexpr auto kCorners = std::to_array<std::array<std::size_t, 2>>({{0, 2}, {1, 2}, {0, 3}, {1, 3}});

// When the values of a region are computed and how far beyond the tile.
class RoundAssignment {
 public:
  RoundAssignment(const Region& region, const std::vector<bool>& live, std::uint32_t halo)
      : nodes_(region.nodes),
        live_(live),
        halo_(halo),
        is_free(nodes_.size(), false),
        level(nodes_.size(), 0),
        extent(nodes_.size(), 0),
        exchange_round(nodes_.size(), kNever),
        exchanged(nodes_.size()),
        reach_(nodes_.size()) {
    assign_levels();
    assign_extents();
  }
  // A round's values are computed after its exchange; those of round 0 need none.
  std::uint32_t round(NodeId id) const { return (level[id] + halo_ - 1) / halo_; }

 private:
  const std::vector<Node>& nodes_;
  const std::vector<bool>& live_;
  const std::uint32_t halo_;

  void assign_levels() {
    for (NodeId id = 0; id < nodes_.size(); ++id) {
      const Node& node = nodes_[id];
      if (!live_[id] || node.is_scalar()) continue;
      if (node.kind == NodeKind::kRead) {
        const NodeId from = node.operands[0];
        level[id] = is_free[from] ? level[from] : level[from] + 1;
        continue;
      }
      bool free =
          node.kind != NodeKind::kHome && node.kind != NodeKind::kSense && node.kind != NodeKind::kActuate;
      for (const NodeId operand : node.operands) {
        if (operand == kNoNode || nodes_[operand].is_scalar()) continue;
        level[id] = std::max(level[id], level[operand]);
        free = free && is_free[operand];
      }
      is_free[id] = free;
    }
  }

  void assign_extents() {
    for (NodeId id = static_cast<NodeId>(nodes_.size()); id-- > 0;) {
      const Node& node = nodes_[id];
      if (!live_[id] || node.is_scalar()) continue;
      extent[id] = reach_[id].most();
      Reach wanted = reach_[id].moved(node.dx, node.dy);
      // At the table's edge a reflected read finds the cell on the other side.
      if (node.kind == NodeKind::kRead && node.rule == BoundaryRule::kReflect)
        for (const auto& [dx, dy] :
             {std::pair(-node.dx, +node.dy), {+node.dx, -node.dy}, {-node.dx, -node.dy}})
          wanted.add(reach_[id].moved(dx, dy));
      for (const NodeId operand : node.operands) {
        if (operand == kNoNode || nodes_[operand].is_scalar()) continue;
        if (is_free[operand] || round(operand) == round(id)) {
          reach_[operand].add(wanted);
        } else if (wanted.most() > 0) {
          exchange_round[operand] = std::min(exchange_round[operand], round(id));
          exchanged[operand].add(wanted);
        }
      }
    }
  }

 public:
  std::vector<bool> is_free;  // computed anywhere without neighbours: constants, coordinates, random numbers
  std::vector<std::uint32_t> level;   // reads on the longest way from the region's begin
  std::vector<std::uint32_t> extent;  // cells beyond the tile's border for which the value is computed
  std::vector<std::uint32_t> exchange_round;
  std::vector<Reach> exchanged;  // the cells that neighbours send

 private:
  std::vector<Reach> reach_;
};

// ---- kernels ----

class RegionScheduler {
 public:
  RegionScheduler(const Region& region, const std::vector<bool>& live,
                  const std::set<std::uint32_t>& homes_after, std::uint32_t halo)
      : region_(region),
        live_(live),
        rounds_(region, live, halo),
        users_(region.nodes.size()),
        is_read_(region.nodes.size()),
        kernel_of_(region.nodes.size(), kNever) {
    for (NodeId id = 0; id < nodes().size(); ++id) {
      if (!live[id]) continue;
      for (const NodeId operand : nodes()[id].operands) {
        if (operand == kNoNode || nodes()[operand].is_scalar()) continue;
        users_[operand].push_back(id);
        if (nodes()[id].kind == NodeKind::kRead) {
          is_read_[operand] = true;
          read_of_[operand] = id;
        }
      }
    }
    for (const auto& [home, id] : region.homes_out)
      if (homes_after.count(home) != 0) leaves_.insert(id);
    form_kernels();
    order();
  }

  std::vector<Step> steps;
  bool has_margin(NodeId id) const { return is_read_[id] || rounds_.extent[id] > 0 || is_exchanged(id); }

 private:
  const std::vector<Node>& nodes() const { return region_.nodes; }

  bool is_exchanged(NodeId id) const { return rounds_.exchanged[id].most() > 0; }
  bool is_plane(NodeId id) const { return live_[id] && !nodes()[id].is_scalar(); }
  // Cheaper to compute than to load, and not needed as a plane.
  bool is_inlined(NodeId id) const {
    const Node& node = nodes()[id];
    const bool cheap = node.kind == NodeKind::kCellX || node.kind == NodeKind::kCellY ||
                       node.kind == NodeKind::kSense ||
                       (node.kind == NodeKind::kPlaneOp && node.op == Opcode::kCopy &&
                        nodes()[node.operands[0]].is_scalar());
    return cheap && !is_read_[id] && !is_exchanged(id) && leaves_.count(id) == 0 &&
           (node.kind != NodeKind::kSense || rounds_.extent[id] == 0);
  }
  bool is_computed(NodeId id) const {
    return is_plane(id) && nodes()[id].kind != NodeKind::kHome && !is_inlined(id);
  }

  struct Class {
    std::uint32_t round = 0, stage = 0, inverse_extent = 0;
    auto operator<=>(const Class&) const = default;
  };

  // Within a round, values that are read by others of the round come first.
  void form_kernels() {
    std::vector<std::uint32_t> stage(nodes().size(), 0);
    std::map<Class, std::vector<NodeId>> classes;
    for (NodeId id = 0; id < nodes().size(); ++id) {
      if (!is_computed(id)) continue;
      const Node& node = nodes()[id];
      for (const NodeId operand : node.operands) {
        if (operand == kNoNode || !is_plane(operand) || !is_computed(operand) ||
            rounds_.round(operand) != rounds_.round(id))
          continue;
        stage[id] = std::max(stage[id], stage[operand] + (node.kind == NodeKind::kRead ? 1 : 0));
      }
      classes[{rounds_.round(id), stage[id], ~rounds_.extent[id]}].push_back(id);
    }
    for (const auto& [which, members] : classes) split_class(which, members);
  }

  // One kernel for each set of values that depend on each other cell by cell.
  void split_class(const Class& which, const std::vector<NodeId>& members) {
    std::map<NodeId, NodeId> parent;
    for (const NodeId id : members) parent[id] = id;
    for (const NodeId id : members) {
      if (nodes()[id].kind == NodeKind::kRead) continue;
      for (const NodeId operand : nodes()[id].operands)
        if (operand != kNoNode && parent.count(operand) != 0) {
          const NodeId a = common::find_root(parent, id), b = common::find_root(parent, operand);
          parent[std::max(a, b)] = std::min(a, b);
        }
    }
    std::map<NodeId, std::vector<NodeId>> sets;
    for (const NodeId id : members) sets[common::find_root(parent, id)].push_back(id);
    for (const auto& [first, set] : sets) {
      for (const NodeId id : set) kernel_of_[id] = static_cast<std::uint32_t>(kernels_.size());
      kernels_.push_back({which, set});
    }
  }

  bool is_stored(NodeId id) const {
    if (nodes()[id].kind == NodeKind::kActuate) return false;
    if (is_read_[id] || is_exchanged(id) || leaves_.count(id) != 0) return true;
    return std::ranges::any_of(users_[id], [&](NodeId user) { return kernel_of_[user] != kernel_of_[id]; });
  }

  void add_inlined(NodeId id, std::vector<NodeId>& to, std::set<NodeId>& seen) const {
    if (!is_inlined(id) || !seen.insert(id).second) return;
    to.push_back(id);
  }

  Step impose(NodeId value) const {
    Step step;
    step.kind = Step::Kind::kImpose;
    step.imposition = {value, read_of_.at(value)};
    return step;
  }

  void order() {
    std::map<std::uint32_t, std::vector<NodeId>> exchanges;
    for (NodeId id = 0; id < nodes().size(); ++id)
      if (is_plane(id) && is_exchanged(id)) exchanges[rounds_.exchange_round[id]].push_back(id);
    std::uint32_t last_round = kernels_.empty() ? 0 : kernels_.back().where.round;
    std::size_t next = 0;
    for (std::uint32_t round = 0; round <= last_round; ++round) {
      if (const auto found = exchanges.find(round); found != exchanges.end()) add_exchange(found->second);
      for (; next < kernels_.size() && kernels_[next].where.round == round; ++next) add_kernel(next);
    }
  }

  void add_exchange(const std::vector<NodeId>& values) {
    Step step;
    step.kind = Step::Kind::kExchange;
    for (const NodeId value : values) {
      step.exchange.strips.push_back({value, rounds_.exchanged[value]});
      step.exchange.has_corners |= rounds_.exchanged[value].has_corners();
    }
    steps.push_back(step);
    for (const NodeId value : values)
      if (is_read_[value]) steps.push_back(impose(value));
  }

  void add_kernel(std::size_t index) {
    Step step;
    std::set<NodeId> seen;
    std::vector<NodeId>& list = step.kernel.nodes;
    for (const NodeId id : kernels_[index].nodes) {
      for (const NodeId operand : nodes()[id].operands)
        if (operand != kNoNode && is_plane(operand)) add_inlined(operand, list, seen);
      list.push_back(id);
      if (is_stored(id)) step.kernel.outputs.push_back(id);
    }
    step.kernel.extent = rounds_.extent[kernels_[index].nodes.front()];
    steps.push_back(step);
    for (const NodeId id : step.kernel.outputs)
      if (is_read_[id] && (rounds_.extent[id] > 0 || !is_exchanged(id))) steps.push_back(impose(id));
  }

  struct Group {
    Class where;
    std::vector<NodeId> nodes;
  };

  const Region& region_;
  const std::vector<bool>& live_;
  const RoundAssignment rounds_;
  std::vector<std::vector<NodeId>> users_;
  std::vector<bool> is_read_;
  std::map<NodeId, NodeId> read_of_;
  std::vector<std::uint32_t> kernel_of_;
  std::set<NodeId> leaves_;  // values that a later region needs
  std::vector<Group> kernels_;
};

// ---- memory ----

// The planes that a step loads: at the cell itself, and at neighbours.
struct Loads {
  std::set<NodeId> own, shifted;
};

Loads loads_of(const Step& step, const std::vector<Node>& nodes) {
  Loads loads;
  if (step.kind == Step::Kind::kImpose) loads.shifted.insert(step.imposition.value);
  for (const Strip& strip : step.exchange.strips) loads.shifted.insert(strip.value);
  const std::set<NodeId> inside(step.kernel.nodes.begin(), step.kernel.nodes.end());
  for (const NodeId id : step.kernel.nodes) {
    for (const NodeId operand : nodes[id].operands) {
      if (operand == kNoNode || nodes[operand].is_scalar()) continue;
      if (nodes[id].kind == NodeKind::kRead)
        loads.shifted.insert(operand);
      else if (inside.count(operand) == 0)
        loads.own.insert(operand);
    }
  }
  return loads;
}

class Allocation {
 public:
  Allocation(Schedule& all) : all_(all) {}

  void allocate(const Region& region, const std::vector<bool>& truth,
                const std::set<std::uint32_t>& homes_after, const RegionScheduler& scheduler,
                RegionSchedule& to) {
    const std::vector<Node>& nodes = region.nodes;
    const auto end = static_cast<std::uint32_t>(to.steps.size());
    std::map<NodeId, std::uint32_t> last_use, last_shifted_use;
    for (std::uint32_t t = 0; t < end; ++t) {
      const Loads loads = loads_of(to.steps[t], nodes);
      for (const NodeId id : loads.own) last_use[id] = t;
      for (const NodeId id : loads.shifted) last_use[id] = last_shifted_use[id] = t;
    }
    // Maps each node to the homes that it ends in.
    std::map<NodeId, std::vector<std::uint32_t>> targets;
    for (const auto& [home, id] : region.homes_out)
      if (homes_after.count(home) != 0) targets[id].push_back(home);
    for (const auto& [id, list] : targets) last_use[id] = last_shifted_use[id] = end;
    std::map<NodeId, Place> places;
    std::map<std::uint32_t, std::uint32_t>
        busy_until;  // home -> the last step that uses what it holds; end: always
    std::set<std::uint32_t> changed;
    for (const auto& [id, list] : targets) changed.insert(list.begin(), list.end());
    for (NodeId id = 0; id < nodes.size(); ++id) {
      if (nodes[id].kind != NodeKind::kHome || last_use.count(id) == 0) continue;
      places[id] = all_.homes.at(nodes[id].index);
      const bool in_step = last_shifted_use.count(id) != 0 && last_shifted_use[id] == last_use[id];
      busy_until[nodes[id].index] = last_use[id] + (in_step ? 1 : 0);
    }
    std::map<Layout, std::set<std::uint32_t>> free = free_;
    std::map<std::uint32_t, std::vector<Place>> released;  // by step
    for (std::uint32_t t = 0; t < end; ++t) {
      for (const Place& place : released[t]) free[place.layout].insert(place.index);
      for (const NodeId id : to.steps[t].kernel.outputs) {
        places[id] = place_output(id, t, {storage_of(nodes[id].type, truth[id]), scheduler.has_margin(id)},
                                  targets, busy_until, free);
        const bool is_home = home_places_.count(places[id]) != 0;
        const bool in_step = last_shifted_use.count(id) != 0 && last_shifted_use[id] == last_use[id];
        if (!is_home && last_use[id] < end) {
          std::vector<Place>& list = released[last_use[id] + (in_step ? 1 : 0)];
          list.push_back(places[id]);
        }
      }
    }
    for (std::uint32_t t = 0; t < end; ++t) {
      const Loads loads = loads_of(to.steps[t], nodes);
      for (const std::set<NodeId>* set : {&loads.own, &loads.shifted})
        for (const NodeId id : *set) to.steps[t].places[id] = places.at(id);
      for (const NodeId id : to.steps[t].kernel.outputs) to.steps[t].places[id] = places.at(id);
    }
    std::vector<Move> moves;
    for (const auto& [id, list] : targets)
      for (const std::uint32_t home : list)
        if (const Place& place = all_.homes.at(home); places.at(id) != place)
          moves.push_back({places.at(id), place});
    order_moves(moves, to.moves);
  }

  void place_homes(const std::map<std::uint32_t, Layout>& layouts) {
    for (const auto& [home, layout] : layouts) {
      const Place place{layout, all_.planes[layout]++};
      all_.homes[home] = place;
      home_places_.insert(place);
    }
  }

 private:
  Place place_output(NodeId id, std::uint32_t t, const Layout& layout,
                     const std::map<NodeId, std::vector<std::uint32_t>>& targets,
                     std::map<std::uint32_t, std::uint32_t>& busy_until,
                     std::map<Layout, std::set<std::uint32_t>>& free) {
    if (const auto found = targets.find(id); found != targets.end()) {
      for (const std::uint32_t home : found->second) {
        const Place& place = all_.homes.at(home);
        const auto busy = busy_until.find(home);
        const bool fits = (place.layout.has_margin || !layout.has_margin) &&
                          (layout.is_truth() || place.layout.storage == layout.storage);
        if (!fits || (busy != busy_until.end() && busy->second > t)) continue;
        busy_until[home] = kNever;
        return place;
      }
    }
    std::set<std::uint32_t>& list = free[layout];
    if (list.empty()) {
      free_[layout].insert(all_.planes[layout]);
      list.insert(all_.planes[layout]++);
    }
    const std::uint32_t index = *list.begin();
    list.erase(list.begin());
    return {layout, index};
  }

  // A plane is overwritten only when no move needs its old value.
  void order_moves(std::vector<Move> pending, std::vector<Move>& ordered) {
    while (!pending.empty()) {
      const auto is_free = [&](const Move& move) {
        return std::ranges::none_of(
            pending, [&](const Move& other) { return &other != &move && other.from == move.to; });
      };
      const auto found = std::ranges::find_if(pending, is_free);
      if (found != pending.end()) {
        ordered.push_back(*found);
        pending.erase(found);
        continue;
      }
      // A circle: its first value waits elsewhere.
      const Place from = pending.front().from;
      const Place aside{from.layout, spare(from.layout)};
      ordered.push_back({from, aside});
      for (Move& move : pending)
        if (move.from == from) move.from = aside;
    }
  }
  std::uint32_t spare(const Layout& layout) {
    const auto [found, is_new] = spare_.try_emplace(layout, 0);
    if (is_new) found->second = all_.planes[layout]++;
    return found->second;
  }

  Schedule& all_;
  std::set<Place> home_places_;
  std::map<Layout, std::set<std::uint32_t>> free_;  // of all regions, where they begin
  std::map<Layout, std::uint32_t> spare_;
};

}  // namespace

bool Reach::has_corners() const {
  for (std::size_t k = 0; k < kCorners.size(); ++k)
    if (sides[kCorners[k][0]] > 0 && sides[kCorners[k][1]] > 0 && corners[k] > 1) return true;
  return false;
}

Reach Reach::moved(int dx, int dy) const {
  const auto longer = [](std::uint32_t& length, int by) {
    length = static_cast<std::uint32_t>(std::max(static_cast<int>(length) + by, 0));
  };
  Reach to = *this;
  const std::array by{-dx, dx, -dy, dy};
  for (std::size_t k = 0; k < 4; ++k) {
    longer(to.sides[k], by[k]);
    longer(to.corners[k], by[kCorners[k][0]] + by[kCorners[k][1]]);
  }
  return to;
}

void Reach::add(const Reach& other) {
  for (std::size_t k = 0; k < 4; ++k) {
    sides[k] = std::max(sides[k], other.sides[k]);
    corners[k] = std::max(corners[k], other.corners[k]);
  }
}

Schedule schedule(TileProgram& program, std::uint32_t halo) {
  Schedule result;
  for (Region& region : program.regions) separate_rules(region);
  const std::vector<Region>& regions = program.regions;
  const std::set<std::uint32_t> numbers = find_number_homes(regions);
  const Liveness liveness(regions);
  std::vector<RegionScheduler> schedulers;
  std::map<std::uint32_t, Layout> layouts;
  result.scalar_is_live.resize(program.scalar_start.size(), false);
  for (std::size_t i = 0; i < regions.size(); ++i) {
    const auto [homes_after, scalars_after] = liveness.after(i);
    const Needs& needs = liveness.of(i);
    schedulers.emplace_back(regions[i], needs.nodes, homes_after, halo);
    RegionSchedule& to = result.regions.emplace_back();
    to.is_truth = find_truths(regions[i], numbers);
    for (const std::uint32_t slot : needs.scalars) result.scalar_is_live[slot] = true;
    for (const auto& [slot, id] : regions[i].scalars_out)
      if (scalars_after.count(slot) != 0) to.scalars_out.emplace_back(slot, id);
    for (NodeId id = 0; id < regions[i].nodes.size(); ++id) {
      const Node& node = regions[i].nodes[id];
      if (needs.nodes[id] && node.is_scalar() && node.kind != NodeKind::kLiteral) to.scalars.push_back(id);
      if (node.kind == NodeKind::kHome && needs.nodes[id])
        layouts[node.index].has_margin |= schedulers.back().has_margin(id);
    }
    for (const std::uint32_t home : homes_after) layouts[home];
    for (const auto& [home, id] : regions[i].homes_out)
      if (homes_after.count(home) != 0) layouts[home].has_margin |= schedulers.back().has_margin(id);
  }
  for (auto& [home, layout] : layouts)
    layout.storage = storage_of(program.homes.type(home), numbers.count(home) == 0);
  Allocation allocation(result);
  allocation.place_homes(layouts);
  for (std::size_t i = 0; i < regions.size(); ++i) {
    RegionSchedule& to = result.regions[i];
    to.steps = schedulers[i].steps;
    allocation.allocate(regions[i], to.is_truth, liveness.after(i).first, schedulers[i], to);
  }
  return result;
}

}  // namespace apron::target_c
