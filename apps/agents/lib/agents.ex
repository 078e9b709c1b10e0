defmodule Agents do
  @moduledoc """
  Exchanges messages between programs on robots: questions and answers, topics, auctions, in the manner of FIPA's
  agents.

  A robot offers a service (`Agents.Responder`), others ask it (`Agents.Conversation`), subscribe to what it tells
  (`Agents.Topic`), or auction a task among many (`Agents.ContractNet`). None of it drives a robot: stops and limits are not theirs.

  An envelope, and whether a template matches it:

      iex> envelope = Agents.Envelope.new(:inform, :mag1, {:battery, 11.8})
      iex> Agents.Template.match?([performative: :inform, from: [:mag1, :mag2]], envelope)
      true

  Its processes belong to their users:

      Robot.Supervisor mag1
      `-- Agents.Responder       one for each service, a companion of the robot's file
      the caller
      `-- Agents.Inbox           one for each conversation or subscription

  Go on with `docs/messages.md`, which is typed by a test.
  """
end
