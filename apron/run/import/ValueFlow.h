// Which values that the import leaves out reach instructions of the chip: a graph over variables, results,
// loops and calls, without regard to the order of statements.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace apron::run {

class ValueFlow {
 public:
  using Node = std::size_t;  // 0 is none
  using Nodes = std::set<Node>;

  // While it lives, statements run only if the node's value says so. The node must have been written.
  class Guard {
   public:
    Guard(ValueFlow& flow, Node node) : flow_(flow) { flow_.guards_.push_back(node); }
    ~Guard() { flow_.guards_.pop_back(); }
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;

   private:
    ValueFlow& flow_;
  };

  // While it lives, reads are those of a part of the text.
  class Part {
   public:
    explicit Part(ValueFlow& flow) : flow_(flow), outer_(std::exchange(flow.reads_, {})) {}
    ~Part() { flow_.reads_ = std::move(outer_); }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;

   private:
    ValueFlow& flow_;
    Nodes outer_;
  };

  // The body of a function: what guards its text where it is translated does not guard it.
  class Body {
   public:
    Body(ValueFlow& flow, Node call)
        : flow_(flow), outer_(std::exchange(flow.guards_, {call})), part_(flow) {}
    ~Body() { flow_.guards_ = std::move(outer_); }
    Body(const Body&) = delete;
    Body& operator=(const Body&) = delete;

   private:
    ValueFlow& flow_;
    std::vector<Node> outer_;
    Part part_;
  };

  struct Place {
    std::size_t line = 0;
    std::string file;
  };
  struct Finding {
    Place place;
    std::string reason;
  };

  Node add() { return ++last_; }
  void read(Node node) { reads_.insert(node); }
  void flow(Node from, Node to) { targets_[from].insert(to); }
  // The node depends on all that has been read in this part, and on the guards.
  void write(Node node);
  // The node depends on the guards.
  void guard(Node node);
  // The value is the controller's.
  void leave_out(Node node, std::string reason) { left_out_.emplace(node, std::move(reason)); }
  // An instruction that depends on what has been read in this part, and on the guards.
  void instruction(Place place);

  // For each value that is left out, the first instruction that it reaches.
  std::vector<Finding> findings() const;

 private:
  Node last_ = 0;
  Nodes reads_;
  std::vector<Node> guards_;
  std::map<Node, Nodes> targets_;
  std::map<Node, std::string> left_out_;
  std::vector<std::pair<Place, Nodes>> instructions_;
};

}  // namespace apron::run
