defmodule Tools.Calibrate.Question do
  @moduledoc "Asks the questions after a course, and reads the answers. Pure."
  alias Hal.Cli.Parse
  alias Console.Cli.Format
  alias Hal.Pose

  @degree :math.pi() / 180

  @doc "The question of a course, and the check of its answer (`Tools.Calibrate.StdinPrompt.ask/3`)."
  @spec of(Lab.Calibration.task()) :: {String.t(), Hal.Cli.Arguments.check()}
  def of({:distance, way}),
    do:
      {"How far is it from its mark, in a straight line, in metres? ",
       &Parse.number(&1, way / 2, way * 2)}

  def of({:angle, turn}) do
    far = abs(turn) / @degree

    {"By how many degrees did it turn in all, such as #{Format.decimals(far, 0)}? ",
     &Parse.number(&1, far / 2, far * 2)}
  end

  def of({:square, _direction, _side}),
    do:
      {"Where does it stand, seen from its mark: X,Y in metres, ahead and to the left? ",
       &Parse.point/1}

  @doc "The measurement: the pose at the end and the turn, as far as this course shows them."
  @spec measured(Lab.Calibration.task(), float() | Pose.point()) :: %{
          measured: Pose.t(),
          turn: float()
        }
  def measured({:distance, _way}, far), do: %{measured: Pose.new(far, 0), turn: 0.0}

  def measured({:angle, turn}, degrees),
    do: %{measured: Pose.new(0, 0), turn: if(turn < 0, do: -degrees, else: degrees) * @degree}

  def measured({:square, _direction, _side}, {x, y}), do: %{measured: Pose.new(x, y), turn: 0.0}
end
