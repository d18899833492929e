#include "apron/run/import/ValueFlow.h"

#include <algorithm>

namespace apron::run {

void ValueFlow::write(Node node) {
  for (const Node one : reads_) flow(one, node);
  guard(node);
}

void ValueFlow::guard(Node node) {
  if (!guards_.empty()) flow(guards_.back(), node);  // which depends on those around it
}

void ValueFlow::instruction(Place place) {
  Nodes nodes = reads_;
  if (!guards_.empty()) nodes.insert(guards_.back());
  instructions_.emplace_back(std::move(place), std::move(nodes));
}

std::vector<ValueFlow::Finding> ValueFlow::findings() const {
  std::vector<Finding> found;
  std::set<std::string> reasons;
  for (const auto& [root, reason] : left_out_) {
    Nodes reached{root};
    std::vector<Node> left{root};
    while (!left.empty()) {
      const Node node = left.back();
      left.pop_back();
      const auto targets = targets_.find(node);
      if (targets == targets_.end()) continue;
      for (const Node one : targets->second)
        if (reached.insert(one).second) left.push_back(one);
    }
    const auto first = std::ranges::find_if(instructions_, [&](const auto& instruction) {
      return std::ranges::any_of(instruction.second, [&](Node node) { return reached.contains(node); });
    });
    if (first != instructions_.end() && reasons.insert(reason).second)
      found.push_back({first->first, reason});
  }
  return found;
}

}  // namespace apron::run
