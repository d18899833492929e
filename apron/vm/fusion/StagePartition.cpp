#include "apron/vm/fusion/StagePartition.h"

#include <algorithm>
#include <map>

#include "apron/vm/Stage.h"

namespace apron::vm {
namespace {

using NodeGroup = StagePartition::NodeGroup;

constexpr std::size_t kMaxStageOps = 64;
constexpr std::size_t kMaxLiveValues = 18;  // live at once in a stage

class StagePartitioner {
 public:
  explicit StagePartitioner(const ValueGraph& graph) : graph_(graph) {}

  StagePartition partition() {
    partition_.stage_of.resize(graph_.nodes.size(), kNoStage);
    partition_.users.resize(graph_.nodes.size());
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      graph_.nodes[i].for_each_value([&](const ValueRef& arg) {
        partition_.users[arg.index].push_back({i, arg.dx, arg.dy});
      });
    group_by_level();
    return std::move(partition_);
  }

 private:
  bool is_computed(std::uint32_t node) const { return graph_.nodes[node].is_computed(); }

  // A use at offset 0 can take the value from a vector register. A shifted use needs finished rows, so it
  // must be in a later stage.
  std::vector<std::uint32_t> compute_levels() const {
    std::vector<std::uint32_t> level(graph_.nodes.size(), 0);
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i)
      if (is_computed(i))
        graph_.nodes[i].for_each_value([&](const ValueRef& arg) {
          if (!is_computed(arg.index)) return;
          const bool after = arg.is_shifted() || !is_fusible(i) || !is_fusible(arg.index);
          level[i] = std::max(level[i], level[arg.index] + (after ? 1U : 0U));
        });
    return level;
  }

  bool is_fusible(std::uint32_t node) const { return is_fusible_opcode(graph_.nodes[node].op); }

  // Moves a value to the level of its first use if its operands are kept until then anyway. This saves a
  // store and a load of the value.
  void sink_values(std::vector<std::uint32_t>& level) const {
    for (auto i = static_cast<std::uint32_t>(graph_.nodes.size()); i-- > 0;) {
      if (!is_computed(i) || !is_fusible(i) || output_count_[i] > 0 || partition_.users[i].empty()) continue;
      std::uint32_t to = kNoStage;
      bool can_sink = true;
      for (const ValueUse& use : partition_.users[i]) {
        to = std::min(to, level[use.node]);
        can_sink = can_sink && use.dx == 0 && use.dy == 0 && is_fusible(use.node);
      }
      graph_.nodes[i].for_each_value([&](const ValueRef& arg) {
        const auto keeps = [&](const ValueUse& use) { return use.node != i && level[use.node] >= to; };
        can_sink =
            can_sink && (!is_computed(arg.index) ||
                         (level[arg.index] < to && std::ranges::any_of(partition_.users[arg.index], keeps)));
      });
      if (can_sink && to > level[i]) level[i] = to;
    }
  }

  void group_by_level() {
    output_count_.assign(graph_.nodes.size(), 0);
    for (const ValueGraph::Output& output : graph_.outputs) ++output_count_[output.value];
    std::vector<std::uint32_t> level = compute_levels();
    sink_values(level);
    // Each level has one group of its fusible nodes, and a group for each other node.
    std::map<std::uint32_t, std::pair<NodeGroup, std::vector<NodeGroup>>> at_level;
    for (std::uint32_t i = 0; i < graph_.nodes.size(); ++i) {
      if (!is_computed(i)) continue;
      auto& [joined, alone] = at_level[level[i]];
      if (is_fusible(i))
        joined.push_back(i);
      else
        alone.push_back({i});
    }
    for (const auto& [at, groups] : at_level) {
      if (!groups.first.empty()) split_to_fit(groups.first);
      partition_.groups.insert(partition_.groups.end(), groups.second.begin(), groups.second.end());
    }
    for (std::uint32_t s = 0; s < partition_.groups.size(); ++s)
      for (const std::uint32_t node : partition_.groups[s]) partition_.stage_of[node] = s;
  }

  void split_to_fit(const NodeGroup& group) {
    if (group.size() == 1 || fits_in_registers(group)) {
      partition_.groups.push_back(group);
      return;
    }
    const auto middle = group.begin() + group.size() / 2;
    split_to_fit(NodeGroup(group.begin(), middle));
    split_to_fit(NodeGroup(middle, group.end()));
  }

  bool fits_in_registers(const NodeGroup& group) const {
    if (group.size() > kMaxStageOps) return false;
    const std::uint32_t last = static_cast<std::uint32_t>(graph_.nodes.size());
    std::map<std::uint32_t, std::uint32_t> last_use;  // of values computed in the group
    for (const std::uint32_t node : group) last_use[node] = node;
    std::vector<std::pair<std::uint32_t, int>> reads;
    for (const std::uint32_t node : group)
      graph_.nodes[node].for_each_value([&](const ValueRef& arg) {
        if (const auto own = last_use.find(arg.index); own != last_use.end() && !arg.is_shifted())
          own->second = node;
        else if (std::ranges::find(reads, std::pair{arg.index, int{arg.dy}}) == reads.end())
          reads.emplace_back(arg.index, arg.dy);
      });
    std::size_t written = 0;
    for (const std::uint32_t node : group)
      if (is_live_out(node, group)) {
        written += std::max<std::size_t>(1, output_count_[node]);
        last_use[node] = last;
      }
    std::size_t max_live = 0;
    for (const std::uint32_t node : group) {
      const auto alive = [&](const auto& use) { return use.first <= node && use.second > node; };
      max_live = std::max<std::size_t>(max_live, std::ranges::count_if(last_use, alive));
    }
    return reads.size() + written <= kMaxStreams && written <= kMaxResults && max_live <= kMaxLiveValues;
  }

  bool is_live_out(std::uint32_t node, const NodeGroup& group) const {
    if (output_count_[node] > 0) return true;
    for (std::uint32_t i = node + 1; i < graph_.nodes.size(); ++i) {
      if (std::binary_search(group.begin(), group.end(), i)) continue;
      bool reads = false;
      graph_.nodes[i].for_each_value([&](const ValueRef& arg) { reads = reads || arg.index == node; });
      if (reads) return true;
    }
    return false;
  }

  const ValueGraph& graph_;
  std::vector<std::size_t> output_count_;
  StagePartition partition_;
};

}  // namespace

StagePartition partition_stages(const ValueGraph& graph) { return StagePartitioner(graph).partition(); }

}  // namespace apron::vm
