// A slope, 4 m high, and the air around it, into which the soil can move.
h = 0.5;
Point(1) = {0, 0, 0, h};  Point(2) = {8, 0, 0, h};  Point(3) = {16, 0, 0, h};
Point(4) = {16, 5, 0, h}; Point(5) = {0, 5, 0, h};  Point(6) = {0, 4, 0, h};  Point(7) = {4, 4, 0, h};
Line(1) = {1, 2}; Line(2) = {2, 7}; Line(3) = {7, 6}; Line(4) = {6, 1};
Line(5) = {2, 3}; Line(6) = {3, 4}; Line(7) = {4, 5}; Line(8) = {5, 6};
Curve Loop(1) = {1, 2, 3, 4};          Plane Surface(1) = {1};
Curve Loop(2) = {5, 6, 7, 8, -3, -2};  Plane Surface(2) = {2};
Physical Curve("floor") = {1, 5};
Physical Curve("back") = {4, 8};
Physical Surface("soil") = {1};
Physical Surface("air") = {2};
