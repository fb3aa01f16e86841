// Heights of points as numbers, with POSIX sockets alone: c++ -std=c++17 binary_heights.cc && ./a.out 127.0.0.1 8080
// /jacksboro/heights
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

int main(int count, char** argv) {
  if (count != 4)
    return std::fputs("binary_heights HOST PORT PATH, such as 127.0.0.1 8080 /jacksboro/heights\n", stderr), 2;
  const std::vector<double> points = {-84.2, 36.3, -84.1, 36.4};  // longitude, latitude
  const std::string body(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(double));
  const std::string message =
      "POST " + std::string(argv[3]) + " HTTP/1.0\r\nHost: " + argv[1] +
      "\r\nContent-Type: application/octet-stream\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" +
      body;
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (const int error = getaddrinfo(argv[1], argv[2], &hints, &found); error != 0)
    return std::fprintf(stderr, "%s: %s\n", argv[1], gai_strerror(error)), 1;
  int connection = -1;
  for (const addrinfo* place = found; place != nullptr && connection < 0; place = place->ai_next) {
    const int tried = socket(place->ai_family, place->ai_socktype, place->ai_protocol);
    if (connect(tried, place->ai_addr, place->ai_addrlen) == 0) {
      connection = tried;
    } else {
      close(tried);  // "localhost" may be ::1, then 127.0.0.1
    }
  }
  freeaddrinfo(found);
  if (connection < 0) return std::fprintf(stderr, "%s:%s: %s\n", argv[1], argv[2], std::strerror(errno)), 1;
  send(connection, message.data(), message.size(), MSG_NOSIGNAL);  // if it fails, there is no reply
  std::string reply;
  char part[65536];
  for (ssize_t size; (size = read(connection, part, sizeof part)) > 0;)
    reply.append(part, static_cast<std::size_t>(size));
  const std::size_t head = reply.find("\r\n\r\n");
  std::vector<float> heights(points.size() / 2);
  const std::size_t bytes = heights.size() * sizeof(float);
  if (reply.find(" 200 ") != 8 || head == std::string::npos || reply.size() - head - 4 != bytes)
    return std::fprintf(stderr, "no heights, but \"%s\"\n", reply.c_str()), 1;
  std::memcpy(heights.data(), reply.data() + head + 4, bytes);
  for (const float height : heights) std::printf("%.3f\n", static_cast<double>(height));
}
