// The cells near bodies as Bullet's kinematic bodies: columns from below the table up to each cell's top, or
// tips.
#pragma once

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/surface/Field.h"
#include "smartsurf/world/bullet/BulletShape.h"

namespace smartsurf::world {

// User indices of Bullet's bodies: 0 … for objects, kGroundIndex, or cell_user_index() for a cell.
inline constexpr int kGroundIndex = -1;
inline int cell_user_index(int cell) { return -2 - cell; }

class CellPool {
 public:
  // depth: of the columns, u. The world and the field must outlive the pool.
  CellPool(btDynamicsWorld&, const surface::Field&, double depth);
  ~CellPool();
  CellPool(const CellPool&) = delete;
  CellPool& operator=(const CellPool&) = delete;

  struct Box {
    btVector3 min, max;  // u
  };
  // Puts the cells whose column reaches into a box into the world and takes out all others. dt_s: the cells'
  // motion to allow for.
  void select_near(std::span<const Box>, double dt_s);

  struct Column {
    int cell;
    double top, speed;  // z of the top, u; vertical velocity, u/s
    double elapsed_s;   // since the start of the step
    btRigidBody* body;
  };
  // Ascending by cell.
  std::span<Column> columns() { return columns_; }
  // The column of a selected cell.
  Column& column(int cell);
  // Moves the column's body to its top and speed, that of a tip to its pose.
  void update_body(const Column&);

 private:
  void find_cells(const Box&, double dt_s);
  template <class Visit>
  void for_each_cell_near(const Box&, Visit) const;
  btRigidBody* take_body(int cell);

  btDynamicsWorld& world_;
  const surface::Field& field_;
  double depth_;
  std::unique_ptr<btBoxShape> box_;
  std::vector<BulletShape> tip_shapes_;  // by index in Field::tips
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<btRigidBody*> free_;
  std::vector<Column> columns_, next_columns_;
  std::vector<int> wanted_;
  // Free layouts: cells by square bucket.
  double bucket_size_ = 1.0, low_x_ = 0.0, low_y_ = 0.0;
  int bucket_rows_ = 0, bucket_columns_ = 0;
  std::vector<std::vector<int>> buckets_;
};

}  // namespace smartsurf::world
