#include "ros/input/cloud_conversion.h"

#include <boost/make_shared.hpp>
#include <cstring>

#include "internal/cloud/point_bvh.h"

namespace ist {

std::string view_cloud(const sensor_msgs::PointCloud2& message, std::size_t max_points,
                       RawCloud* raw) {
  CloudLayout layout;
  for (const sensor_msgs::PointField& field : message.fields) {
    layout.fields.push_back({field.name, field.offset, field.datatype, field.count});
  }
  layout.width = message.width;
  layout.height = message.height;
  layout.point_step = message.point_step;
  layout.row_step = message.row_step;
  layout.is_bigendian = message.is_bigendian;
  layout.data = message.data.data();
  layout.data_size = message.data.size();
  return check_layout(layout, raw, max_points);
}

sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame) {
  auto message = boost::make_shared<sensor_msgs::PointCloud2>();
  message->header.stamp = stamp;
  message->header.frame_id = fixed_frame;
  const char* names[] = {"x", "y", "z"};
  for (std::uint32_t i = 0; i < 3; ++i) {
    sensor_msgs::PointField field;
    field.name = names[i];
    field.offset = 4 * i;
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    message->fields.push_back(field);
  }
  message->height = 1;
  message->width = static_cast<std::uint32_t>(snapshot.index.size());
  message->point_step = 12;
  message->row_step = message->point_step * message->width;
  message->is_dense = true;
  message->data.resize(message->row_step);

  std::uint8_t* out = message->data.data();
  const Eigen::Isometry3d& X_FO = snapshot.index.X_FO();
  PointTile scratch;
  const PointBvh& points = snapshot.index.bvh();
  for (std::size_t number = 0; number < points.tile_count(); ++number) {
    const PointTile& tile = points.tile(number, &scratch);
    for (int i = 0; i < tile.count; ++i) {
      const Eigen::Vector3f p_F = (X_FO * tile.point(i)).cast<float>();
      std::memcpy(out, p_F.data(), 3 * sizeof(float));
      out += 3 * sizeof(float);
    }
  }
  return message;
}

}  // namespace ist
