#include "apron/vm/Stages.h"

#include <algorithm>
#include <map>

#include "apron/vm/Plan.h"

namespace apron::vm {
namespace {

using program::Opcode;
using Group = Stages::Group;

constexpr std::size_t kMaxOps = 48;    // of a stage
constexpr std::size_t kMaxAlive = 18;  // values of a stage alive at once

class Grouping {
 public:
  explicit Grouping(const Graph& graph) : graph_(graph) {}

  Stages run() {
    stages_.stage_of.resize(graph_.nodes.size(), kNoStage);
    stages_.users.resize(graph_.nodes.size());
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      each_value(i, [&](const Arg& arg) { stages_.users[arg.index].push_back({i, arg.dx, arg.dy}); });
    group_by_level();
    return std::move(stages_);
  }

 private:
  bool computed(std::uint32_t node) const { return graph_.nodes[node].computed(); }
  template <class With>
  void each_value(std::uint32_t node, const With& with) const {
    graph_.nodes[node].each_value(with);
  }

  // A value read from the own cell can stay in a vector register; one read from a neighbour's needs its rows
  // done.
  std::vector<std::uint32_t> levels() const {
    std::vector<std::uint32_t> level(graph_.nodes.size(), 0);
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      if (computed(i))
        each_value(i, [&](const Arg& arg) {
          if (!computed(arg.index)) return;
          const bool after = arg.shifted() || !joins(i) || !joins(arg.index);
          level[i] = std::max(level[i], level[arg.index] + (after ? 1U : 0U));
        });
    return level;
  }

  bool joins(std::uint32_t node) const { return joins_stages(graph_.nodes[node].op); }

  // What only a later level reads is computed there, if its operands are kept until then anyway: one value
  // less goes through memory.
  void sink(std::vector<std::uint32_t>& level) const {
    for (auto i = static_cast<std::uint32_t>(graph_.nodes.size()); i-- > 0;) {
      if (!computed(i) || !joins(i) || outputs_of_[i] > 0 || stages_.users[i].empty()) continue;
      std::uint32_t to = kNoStage;
      bool free = true;
      for (const Use& use : stages_.users[i]) {
        to = std::min(to, level[use.node]);
        free = free && use.dx == 0 && use.dy == 0 && joins(use.node);
      }
      each_value(i, [&](const Arg& arg) {
        const auto keeps = [&](const Use& use) { return use.node != i && level[use.node] >= to; };
        free = free && (!computed(arg.index) ||
                        (level[arg.index] < to && std::any_of(stages_.users[arg.index].begin(),
                                                              stages_.users[arg.index].end(), keeps)));
      });
      if (free && to > level[i]) level[i] = to;
    }
  }

  void group_by_level() {
    outputs_of_.assign(graph_.nodes.size(), 0);
    for (const Graph::Output& output : graph_.outputs) ++outputs_of_[output.value];
    std::vector<std::uint32_t> level = levels();
    sink(level);
    std::map<std::uint32_t, std::pair<Group, std::vector<Group>>> at_level;  // joined, and each by itself
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!computed(i)) continue;
      auto& [joined, alone] = at_level[level[i]];
      if (joins(i))
        joined.push_back(i);
      else
        alone.push_back({i});
    }
    for (const auto& [at, groups] : at_level) {
      if (!groups.first.empty()) split(groups.first);
      stages_.groups.insert(stages_.groups.end(), groups.second.begin(), groups.second.end());
    }
    for (std::uint32_t s = 0; s < stages_.groups.size(); ++s)
      for (const std::uint32_t node : stages_.groups[s]) stages_.stage_of[node] = s;
  }

  void split(const Group& group) {
    if (group.size() == 1 || fits(group)) {
      stages_.groups.push_back(group);
      return;
    }
    const auto middle = group.begin() + static_cast<std::ptrdiff_t>(group.size() / 2);
    split(Group(group.begin(), middle));
    split(Group(middle, group.end()));
  }

  bool fits(const Group& group) const {
    if (group.size() > kMaxOps) return false;
    const std::uint32_t last = static_cast<std::uint32_t>(graph_.nodes.size());
    std::map<std::uint32_t, std::uint32_t> last_use;  // of the group's own values
    for (const std::uint32_t node : group) last_use[node] = node;
    std::vector<std::pair<std::uint32_t, int>> reads;
    for (const std::uint32_t node : group)
      each_value(node, [&](const Arg& arg) {
        if (const auto own = last_use.find(arg.index); own != last_use.end() && !arg.shifted())
          own->second = node;
        else if (std::find(reads.begin(), reads.end(), std::pair{arg.index, int{arg.dy}}) == reads.end())
          reads.emplace_back(arg.index, arg.dy);
      });
    std::size_t written = 0;
    for (const std::uint32_t node : group)
      if (leaves(node, group)) {
        written += std::max<std::size_t>(1, outputs_of_[node]);
        last_use[node] = last;
      }
    std::size_t most = 0;
    for (const std::uint32_t node : group) {
      const auto alive = [&](const auto& use) { return use.first <= node && use.second > node; };
      most = std::max(most, static_cast<std::size_t>(std::count_if(last_use.begin(), last_use.end(), alive)));
    }
    return reads.size() + written <= kMaxStreams && written <= kMaxResults && most <= kMaxAlive;
  }

  bool leaves(std::uint32_t node, const Group& group) const {
    if (outputs_of_[node] > 0) return true;
    for (std::uint32_t i = node + 1; i < graph_.nodes.size(); ++i) {
      if (std::binary_search(group.begin(), group.end(), i)) continue;
      bool reads = false;
      each_value(i, [&](const Arg& arg) { reads = reads || arg.index == node; });
      if (reads) return true;
    }
    return false;
  }

  const Graph& graph_;
  std::vector<std::size_t> outputs_of_;
  Stages stages_;
};

}  // namespace

Stages find_stages(const Graph& graph) { return Grouping(graph).run(); }

bool joins_stages(Opcode op) noexcept {
  switch (op) {
    case Opcode::kPow:
    case Opcode::kAtan2:
    case Opcode::kRound:
      return false;
    default:
      return op < Opcode::kSin || op == Opcode::kSqrt || op == Opcode::kFloor || op == Opcode::kCeil;
  }
}

}  // namespace apron::vm
