// The ways of a program through a tick.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "apron/target_c/Schedule.h"

namespace apron::target_c {

// Follows the scalars that a tick itself determines, such as the counters of loops.
class TickPaths {
 public:
  TickPaths(const TileProgram& program, const Schedule& schedule);

  // The most of a quantity, given by region, that a tick meets. A loop whose passes only run time shows
  // counts once.
  double most(const std::vector<double>& quantity) const;
  // True if such a loop has some of it.
  bool is_open(const std::vector<double>& quantity) const;

 private:
  // A region, and the bits of the scalars that are known where it begins, by slot.
  using State = std::pair<std::uint32_t, std::map<std::uint32_t, std::uint64_t>>;
  struct Node {
    std::uint32_t region = 0;
    std::vector<std::size_t> next;
    std::size_t component = 0;
  };

  bool explore(const TileProgram& program, const Schedule& schedule, bool follows_scalars);
  void find_components();

  std::vector<Node> nodes_;
  std::vector<std::size_t> backwards_;  // each after those that follow it, except in loops
  std::vector<bool> is_loop_;           // by component: strongly connected
};

}  // namespace apron::target_c
