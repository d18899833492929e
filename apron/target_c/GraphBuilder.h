// Builds the nodes of a region: what is known at compile time is computed.
#pragma once

#include <bit>
#include <map>
#include <optional>
#include <vector>

#include "apron/program/ScalarArithmetic.h"
#include "apron/target_c/TileGraph.h"

namespace apron::target_c {

// Nodes with equal operands are one.
class GraphBuilder {
 public:
  explicit GraphBuilder(std::vector<Node>& nodes) : nodes_(nodes) {}

  NodeId add(const Node& node) {
    const Key key{static_cast<std::uint64_t>(node.kind) | static_cast<std::uint64_t>(node.op) << 8U |
                      static_cast<std::uint64_t>(static_cast<std::uint8_t>(node.dx)) << 16U |
                      static_cast<std::uint64_t>(static_cast<std::uint8_t>(node.dy)) << 24U |
                      static_cast<std::uint64_t>(node.rule) << 32U |
                      static_cast<std::uint64_t>(node.draws_follow) << 40U |
                      static_cast<std::uint64_t>(node.type) << 41U,
                  node.operands[0],
                  node.operands[1],
                  node.operands[2],
                  std::bit_cast<std::uint64_t>(node.literal),
                  node.index,
                  node.draw};
    const auto [found, is_new] = index_.try_emplace(key, static_cast<NodeId>(nodes_.size()));
    if (is_new) nodes_.push_back(node);
    return found->second;
  }
  NodeId literal(double value) {
    Node node;
    node.literal = value;
    return add(node);
  }
  std::optional<double> value(NodeId id) const {
    if (nodes_[id].kind != NodeKind::kLiteral) return std::nullopt;
    return nodes_[id].literal;
  }
  const Node& node(NodeId id) const { return nodes_[id]; }
  bool is_scalar(NodeId id) const { return nodes_[id].is_scalar(); }
  std::size_t size() const { return nodes_.size(); }

  NodeId apply(program::Opcode op, NodeId a, NodeId b = kNoNode, NodeId c = kNoNode) {
    Node node;
    node.op = op;
    node.operands = {a, b, c};
    bool scalar = true, literal = true;
    for (const NodeId id : node.operands) {
      if (id == kNoNode) continue;
      if (scalar && !is_scalar(id)) node.type = nodes_[id].type;
      scalar = scalar && is_scalar(id);
      literal = literal && value(id).has_value();
    }
    if (scalar && literal) {
      const auto number = [&](NodeId id) { return id == kNoNode ? 0.0 : *value(id); };
      return this->literal(program::evaluate_scalar(op, number(a), number(b), number(c)));
    }
    if (op == program::Opcode::kCopy) return a;
    node.kind = scalar ? NodeKind::kScalarOp : NodeKind::kPlaneOp;
    return add(node);
  }
  // The same on registers of that type, of which scalars become numbers first.
  NodeId apply_plane(program::CellType type, program::Opcode op, NodeId a, NodeId b = kNoNode,
                     NodeId c = kNoNode) {
    if (op == program::Opcode::kCopy && !is_scalar(a)) return a;
    Node node;
    node.kind = NodeKind::kPlaneOp;
    node.op = op;
    node.type = type;
    node.operands = {a, b, c};
    return add(node);
  }

 private:
  using Key = std::array<std::uint64_t, 7>;
  std::vector<Node>& nodes_;
  std::map<Key, NodeId> index_;
};

}  // namespace apron::target_c
