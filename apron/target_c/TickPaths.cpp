#include "apron/target_c/TickPaths.h"

#include <algorithm>
#include <bit>
#include <optional>

#include "apron/program/ScalarArithmetic.h"

namespace apron::target_c {
namespace {

constexpr std::size_t kMaxStates = 65000, kMaxKnown = 2'000'000;

using KnownScalars = std::map<std::uint32_t, std::uint64_t>;

// The scalars of a region, as far as they are known.
class Scalars {
 public:
  Scalars(const Region& region, const RegionSchedule& plan, const KnownScalars& known) : region_(region) {
    for (const NodeId id : plan.scalars) {
      const Node& node = region.nodes[id];
      if (node.kind == NodeKind::kScalarEntry) {
        if (const auto found = known.find(node.index); found != known.end())
          values_[id] = std::bit_cast<double>(found->second);
      } else if (node.kind == NodeKind::kScalarOp) {
        std::array<double, 3> from{};
        bool is_known = true;
        for (std::size_t k = 0; k < from.size() && node.operands[k] != kNoNode; ++k) {
          const std::optional<double> operand = value(node.operands[k]);
          is_known = is_known && operand.has_value();
          from[k] = operand.value_or(0.0);
        }
        if (is_known) values_[id] = program::evaluate_scalar(node.op, from[0], from[1], from[2]);
      }
    }
  }
  std::optional<double> value(NodeId id) const {
    if (region_.nodes[id].kind == NodeKind::kLiteral) return region_.nodes[id].literal;
    const auto found = values_.find(id);
    return found == values_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  const Region& region_;
  std::map<NodeId, double> values_;
};

}  // namespace

TickPaths::TickPaths(const TileProgram& program, const Schedule& schedule) {
  if (!explore(program, schedule, true)) explore(program, schedule, false);
  find_components();
}

// False if there are too many states.
bool TickPaths::explore(const TileProgram& program, const Schedule& schedule, bool follows_scalars) {
  nodes_.clear();
  std::map<State, std::size_t> index;
  std::vector<const State*> states;
  std::size_t known_count = 0;
  const auto enter = [&](std::uint32_t region, const KnownScalars& known) {
    const auto [found, is_new] = index.try_emplace({region, known}, nodes_.size());
    if (is_new) {
      nodes_.push_back({region, {}, 0});
      states.push_back(&found->first);
      known_count += known.size();
    }
    return found->second;
  };
  enter(0, {});
  for (const Region& region : program.regions)
    if (region.ending == Ending::kStep) enter(region.next[0], {});
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (follows_scalars && (nodes_.size() > kMaxStates || known_count > kMaxKnown)) return false;
    const Region& region = program.regions[nodes_[i].region];
    if (region.ending != Ending::kJump && region.ending != Ending::kBranch) continue;
    const RegionSchedule& plan = schedule.regions[nodes_[i].region];
    KnownScalars known = states[i]->second;
    const Scalars scalars(region, plan, known);
    for (const auto& [slot, id] : plan.scalars_out) {
      known.erase(slot);
      if (const auto value = scalars.value(id); value && follows_scalars)
        known[slot] = std::bit_cast<std::uint64_t>(*value);
    }
    std::array<bool, 2> is_taken{true, region.ending == Ending::kBranch};
    if (region.ending == Ending::kBranch)
      if (const auto a = scalars.value(region.a), b = scalars.value(region.b); a && b)
        is_taken[(program::evaluate_scalar(region.comparison, *a, *b, 0.0) != 0.0) == region.expected] =
            false;
    for (std::size_t k = 0; k < 2; ++k)
      if (is_taken[k]) {
        const std::size_t next = enter(region.next[k], known);
        nodes_[i].next.push_back(next);
      }
  }
  return true;
}

// Kosaraju's algorithm: the components are numbered in the order of the tick.
void TickPaths::find_components() {
  constexpr std::size_t kNone = ~std::size_t{0};
  std::vector<std::size_t> order;  // each after those that follow it
  std::vector<std::vector<std::size_t>> before(nodes_.size());
  std::vector<bool> is_seen(nodes_.size());
  std::vector<std::pair<std::size_t, std::size_t>> path;  // a node, and the next of its followers
  for (std::size_t root = 0; root < nodes_.size(); ++root) {
    if (is_seen[root]) continue;
    is_seen[root] = true;
    path.emplace_back(root, 0);
    while (!path.empty()) {
      auto& [at, follower] = path.back();
      if (follower == nodes_[at].next.size()) {
        order.push_back(at);
        path.pop_back();
        continue;
      }
      const std::size_t next = nodes_[at].next[follower++];
      before[next].push_back(at);
      if (is_seen[next]) continue;
      is_seen[next] = true;
      path.emplace_back(next, 0);
    }
  }
  for (Node& node : nodes_) node.component = kNone;
  for (auto root = order.rbegin(); root != order.rend(); ++root) {
    if (nodes_[*root].component != kNone) continue;
    const std::size_t component = is_loop_.size();
    is_loop_.push_back(false);
    nodes_[*root].component = component;
    std::vector<std::size_t> left{*root};
    while (!left.empty()) {
      const std::size_t at = left.back();
      left.pop_back();
      backwards_.push_back(at);
      for (const std::size_t from : before[at]) {
        if (nodes_[from].component == component) is_loop_[component] = true;
        if (nodes_[from].component != kNone) continue;
        is_loop_[component] = true;
        nodes_[from].component = component;
        left.push_back(from);
      }
    }
  }
  std::ranges::reverse(backwards_);
}

double TickPaths::most(const std::vector<double>& quantity) const {
  std::vector<double> own(is_loop_.size()), after(is_loop_.size());
  double most = 0.0;
  for (const std::size_t i : backwards_) {
    const auto& [region, next, component] = nodes_[i];
    own[component] += quantity[region];
    for (const std::size_t n : next)
      if (const std::size_t to = nodes_[n].component; to != component)
        after[component] = std::max(after[component], own[to] + after[to]);
    most = std::max(most, own[component] + after[component]);
  }
  return most;
}

bool TickPaths::is_open(const std::vector<double>& quantity) const {
  return std::ranges::any_of(
      nodes_, [&](const Node& node) { return is_loop_[node.component] && quantity[node.region] > 0.0; });
}

}  // namespace apron::target_c
