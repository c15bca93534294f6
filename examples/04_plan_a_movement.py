"""Make a human-like movement through random points, plan it for the UR3, see how near the limits are."""

from pc_client.movements.description import describe
from pc_client.movements.generate import generate_movement
from pc_client.planning.plan import plan_movement


def main() -> None:
    movement = generate_movement("lognormal", 5, seed=42)
    figures = describe(movement)
    print(f"{movement.name}: {movement.duration:.2f} s, top speed {figures['peak_speed_m_s']:.3f} m/s")
    plan = plan_movement(movement)
    for line in plan.report.lines():
        print(line)


if __name__ == "__main__":
    main()
