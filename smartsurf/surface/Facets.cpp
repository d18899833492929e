#include "smartsurf/surface/Facets.h"

namespace smartsurf::surface {
namespace {

class Builder {
 public:
  void add(const Eigen::Vector3f& normal, float offset) {
    if (lane_ == 0) facets_.emplace_back();
    FacetBlock& block = facets_.back();
    block.x[lane_] = normal.x();
    block.y[lane_] = normal.y();
    block.z[lane_] = normal.z();
    block.offset[lane_] = offset;
    lane_ = (lane_ + 1) % FacetBlock::kLanes;
  }
  Facets take() { return std::move(facets_); }

 private:
  Facets facets_;
  int lane_ = 0;
};

Facets of_box(const Eigen::Vector3f& half) {
  Builder b;
  for (int i = 0; i < 3; ++i)
    for (const float side : {1.0F, -1.0F}) b.add(side * Eigen::Vector3f::Unit(i), half[i]);
  return b.take();
}

Facets of_piece(const scene::ConvexPiece& piece) {
  Builder b;
  for (const scene::ConvexPiece::Face& face : piece.faces) b.add(face.normal, face.offset);
  return b.take();
}

}  // namespace

Polyhedron polyhedron_of(const scene::ObjectSpec& object) {
  Polyhedron all{object.solid.get(), {}};
  if (object.solid)
    for (const scene::ConvexPiece& piece : object.solid->pieces) all.pieces.push_back(of_piece(piece));
  else
    all.pieces.push_back(of_box(object.half_extents().cast<float>()));
  return all;
}

}  // namespace smartsurf::surface
