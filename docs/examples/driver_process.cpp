// A driver in a process of its own, as driver_process.py: driver_process PORT; then sim --policy driver:PORT.
// protoc --cpp_out=. driver.proto && g++ -O2 driver_process.cpp driver.pb.cc -o driver_process -lprotobuf -pthread
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <unistd.h>

#include <cmath>
#include <map>

#include "driver.pb.h"
using namespace scenarionet::driver::v1;
using Point = std::pair<double, double>;

bool receive(int from, void* to, size_t size) { return recv(from, to, size, MSG_WAITALL) == ssize_t(size); }
double clip(double value) { return std::fmax(-1.0, std::fmin(1.0, value)); }

Point local(const Ego& ego, double x, double y) {
  double dx = x - ego.x(), dy = y - ego.y(), cos = std::cos(ego.heading()), sin = std::sin(ego.heading());
  return {cos * dx + sin * dy, cos * dy - sin * dx};
}

bool is_blocked(const Ego& ego, const Objects& objects) {
  for (int i = 0; i < objects.x_size(); ++i) {
    auto [x, y] = local(ego, objects.x(i), objects.y(i));
    if (x > 0 && x < 8 + ego.speed() * ego.speed() / 6 && std::fabs(y) < 1.5) return true;
  }
  return false;
}

void drive(const std::vector<Point>& route, const Ego& ego, bool blocked, Action* action) {
  double x = 0, y = 0, reach = std::fmax(4.0, ego.speed());
  for (auto [px, py] : route) {
    std::tie(x, y) = local(ego, px, py);
    if (x > 0 && std::hypot(x, y) >= reach) break;
  }
  x += 0.3 * ego.length();
  action->set_steering(clip(std::atan(0.6 * ego.length() * 2 * y / (x * x + y * y)) / (40 * M_PI / 180)));
  action->set_throttle(clip(blocked ? -1.0 : 0.5 * (8.0 - ego.speed())));
}

int main(int, char** words) {
  int server = socket(AF_INET, SOCK_STREAM, 0), yes = 1;
  sockaddr_in place{AF_INET, htons(std::stoi(words[1])), {htonl(INADDR_LOOPBACK)}, {}};
  setsockopt(server, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  if (bind(server, (sockaddr*)&place, sizeof place) || listen(server, 1)) return perror("driver"), 1;
  for (int peer; (peer = accept(server, nullptr, nullptr)) >= 0; close(peer)) {
    setsockopt(peer, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    std::map<uint64_t, std::vector<Point>> routes;
    for (uint32_t size; receive(peer, &size, 4);) {  // on a machine whose lowest byte is first
      std::string content(size, 0);
      Moments moments;
      Commands commands;
      if (!receive(peer, content.data(), size) || !moments.ParseFromString(content)) break;
      for (const Moment& moment : moments.moments()) {
        auto& route = routes[moment.episode()];
        const Begin& begin = moment.begin();
        for (int i = 0; i < begin.route_x_size(); ++i) route.emplace_back(begin.route_x(i), begin.route_y(i));
        for (int i = 0; i < begin.beyond_x_size(); ++i) route.emplace_back(begin.beyond_x(i), begin.beyond_y(i));
        Command* command = commands.add_commands();
        command->set_episode(moment.episode());
        drive(route, moment.ego(), is_blocked(moment.ego(), moment.objects()), command->mutable_action());
      }
      size = commands.ByteSizeLong();
      content = std::string((char*)&size, 4) + commands.SerializeAsString();
      if (send(peer, content.data(), content.size(), 0) < 0) break;
    }
  }
}
