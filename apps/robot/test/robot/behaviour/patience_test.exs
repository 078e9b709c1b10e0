defmodule Robot.Behaviour.PatienceTest do
  use ExUnit.Case, async: true
  alias Robot.Behaviour.Patience
  doctest Robot.Behaviour.Patience

  # What is left of the way (metres) at each tenth of a second; since when it is late, in seconds.
  defp late_at(seconds, left, turn \\ 1.0) do
    0..(10 * seconds)
    |> Enum.reduce_while(nil, fn n, patience ->
      patience = Patience.note(patience, left.(n / 10), 100 * n)
      if Patience.late?(patience, turn), do: {:halt, {:late, n / 10}}, else: {:cont, patience}
    end)
    |> case do
      {:late, at_s} -> at_s
      %Patience{} = patience -> patience
    end
  end

  test "a robot that comes nearer is in time, however slowly; one that stands is late after 15 s" do
    assert %Patience{} = late_at(120, &(9.0 - 0.01 * &1))
    assert late_at(120, fn _ -> 3.0 end) == 15.0
    assert_in_delta late_at(120, &max(3.0, 5.0 - &1)), 16.7, 0.3
  end

  test "movement is not approach: neither twitching nor a last step of a centimetre is" do
    assert late_at(120, &(3.0 + 0.1 * :math.sin(&1))) <= 17.0
    # It gained 0.09 m in its first second, and a centimetre more at 14 s.
    assert late_at(120, fn s -> if s < 14, do: max(2.91, 3.0 - 0.09 * s), else: 2.89 end) <= 17.0
    # Each new best is a millimetre better.
    assert late_at(120, &(3.0 - 0.001 * &1)) == 15.0
  end

  test "another way begins the time again, ten times at most" do
    assert_in_delta late_at(120, fn s -> if s < 14, do: 3.0, else: 6.0 end), 29.0, 0.11
    # A straight line has no other ways: going round something is no approach either.
    straight =
      Enum.reduce(0..150, nil, fn n, patience ->
        Patience.note(patience, if(n < 40, do: 3.0, else: 6.0), 100 * n, :straight)
      end)

    assert Patience.late?(straight, 1.0)
    ways = fn s -> 3.0 + 1.5 * trunc(s / 10) end
    assert_in_delta late_at(400, ways), 115.0, 1.0
  end

  test "time in which nothing was decided does not count, and what is remembered stays small" do
    patience = Patience.note(nil, 3.0, 0) |> Patience.note(3.0, 60_000)
    refute Patience.late?(patience, 1.0)
    patience = late_at(1_000, &(100.0 - 0.05 * &1))
    assert length(patience.past) <= 130
    assert late_at(120, fn _ -> 3.0 end, 0.2) == 36.5
  end
end
